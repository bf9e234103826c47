"""Fly helicopters in Gymnasium: an agent of a few lines tracks velocities and headings.

    python scripts/fly_in_gymnasium.py [EPISODES]

Each episode has a helicopter, a wind, and commands of its own. The gyro keeps the rates that the
sticks ask for, so the agent's law is that of a patient pilot: an attitude for the velocity that is
missing, a stick for the attitude.
"""

import sys

import gymnasium
import numpy as np

import helisim.gym

# tilt for velocity, rad s/m; stick for tilt, 1/rad; the tilt to the right of the hover, rad
TILT, STICK, HOVERS_AT = 0.15, 1.2, 0.067


def agent(seen: np.ndarray) -> np.ndarray:
    """Return actions (n, 4) for scaled observations (n, 17), of COL, LON, LAT and PED."""
    ahead, right, below, turn = *seen[:, :3].T, np.arctan2(seen[:, 3], seen[:, 4])
    phi, theta = 0.2 * seen[:, 8], 0.2 * seen[:, 9]
    col = -0.1 * below
    lon = STICK * (np.clip(-TILT * ahead, -0.3, 0.3) - theta)
    lat = STICK * (np.clip(TILT * right, -0.3, 0.3) + HOVERS_AT - phi)
    ped = 0.3 * turn
    return np.column_stack([col, lon, lat, ped])


def flown(env, act, seed: int) -> tuple[np.ndarray, ...]:
    """Return each one's return, frames, m off at last, and whether it was lost, (n,)."""
    seen, _ = env.reset(seed=seed)
    score, frames, off = np.zeros((3, len(seen)))
    flying = np.ones(len(seen), dtype=bool)
    for _ in range(500):
        off[flying] = np.linalg.norm(seen[flying, :3], axis=1)
        seen, reward, terminated, _, _ = env.step(act(seen))
        score += reward * flying
        frames += flying
        flying &= ~terminated
    env.close()
    return score, frames, off, ~flying


def main(episodes: int = 32) -> None:
    """Print what is seen, and how the episodes went."""
    env = gymnasium.make_vec(
        "helisim/Track-v0",
        num_envs=episodes,
        vectorization_mode="vector_entry_point",
        spread=helisim.gym.USUAL,
        weather=helisim.gym.WeatherRange(wind=3.0, turbulence=5.0),
    )
    for one in env.unwrapped.observations:
        print(f"{one.name:22}{one.unit:7}{one.scale:<6g}{one.meaning}")
    score, _, _, lost = flown(env, agent, 1)
    print(f"{episodes} episodes: mean return {score.mean():.0f} of 500, {lost.sum()} lost")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
