"""Frequency responses from the best prediction of each sample by all before it, without reference.

With y(t) = K_y y + K_u u + e(t) over lags, by least squares, H = (1 - K_y)^-1 K_u (L. Ljung, System
Identification: Theory for the User, 2nd ed., 1999, ch. 7 and 13). What a gust brings at t can't
have come back into u before t: feedback by a law, or by a pilot who answers gusts, biases nothing
as long as the lags are enough to foresee gusts. Lags are single ones, then means over wider ones.

A servo at its limit of speed lags the more, the larger the command. The cube of each input's speed
is one more input, over short lags, so that H is the response to small motion, where that predicts
better by more than chance (G. Schwarz, Ann. Statist. 6, 1978): where nothing is at a limit, cubes
take jumps, which tell most, for one. A cube is not all of such a limit: what it moves the response
by is one more error, with cubes and without. Accelerations answer a jump at once, wherever it lies
between two samples here, which cubes would take for a limit: theirs is without cubes.
"""

from collections.abc import Sequence

import numpy as np

from helisim.ident.local import Local
from helisim.ident.scatter import Estimate, LineWeights, LocalScatter
from helisim.records.record import ACCELERATIONS

# rad of the band's top between samples, where accelerations answer; of its lower edge in all lags
_TICK, _AT_ONCE, _MEMORY = 0.45, 0.3, 4.0
# Lags until their means grow wider, by a factor of e in as many; s, for which a servo may be late
_SINGLE, _SLEWS = 5.0, 0.12


class Predictor(Local):
    """Records, for responses to inputs at (n_freq,) rad/s; a reference adds nothing."""

    def estimate(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        others: Sequence[str],
        reference: Sequence[str],
    ) -> Estimate:
        """Return the responses with their errors."""
        names, n_out, omega = (*outputs, *inputs, *others), len(outputs), self._frequency
        jumps = bool({*outputs} & {*ACCELERATIONS})
        longest = max(one.sample_time for one in self._records)
        tick = max(round((_AT_ONCE if jumps else _TICK) / (omega[-1] * longest)), 1) * longest
        count = _SINGLE * np.arcsinh(_MEMORY / (omega[0] * tick * _SINGLE))
        edges = np.rint(_SINGLE * np.sinh(np.arange(count + 1.0) / _SINGLE)).astype(np.intp)
        wide, slow, parts, told = np.diff(edges), edges[1:] * tick <= _SLEWS, [], []
        for one in self._records:
            size = max(round(tick / one.sample_time), 1)
            values = one.select(names)[: len(one) // size * size].reshape(-1, size, len(names))
            mean = values.mean(axis=1) - values.mean(axis=(0, 1))
            speed = np.diff(mean[:, n_out:], axis=0, prepend=mean[:1, n_out:])
            total = np.cumsum(np.pad(np.hstack([mean, speed**3]), ((1, 0), (0, 0))), axis=0)
            at = np.arange(edges[-1], len(mean))
            before = -np.diff(total[at[:, None] - edges], axis=1) / wide[:, None]
            parts.append(
                np.hstack(
                    [
                        before[:, :, : len(names)].reshape(at.size, -1),
                        before[:, slow, len(names) :].reshape(at.size, -1),
                        mean[at, :n_out],
                    ]
                )
            )
        rows, now = np.split(np.concatenate(parts), [-n_out], axis=1)
        turn, linear = np.exp(-1j * tick * omega)[:, None], wide.size * len(names)
        lag = -np.diff(turn ** (edges + 1), axis=1) / ((1.0 - turn) * wide)
        for some in (rows, rows[:, :linear]):
            unit = 1.0 / (some.std(axis=0) + 1e-300)
            left, size, right = np.linalg.svd(some * unit, full_matrices=False)
            root = (unit[:, None] * right.T / np.maximum(size, 1e-9 * size[0]))[:linear]
            kernel = np.einsum(
                "fw,wso->fos", lag, (root @ (left.T @ now)).reshape(wide.size, len(names), n_out)
            )
            inverse = np.linalg.inv(np.eye(n_out) - kernel[:, :, :n_out])
            rest, free = now - left @ (left.T @ now), len(rows) - some.shape[1]
            told.append(
                (
                    len(rows) * np.linalg.slogdet(rest.T @ rest)[1]
                    - n_out * free * np.log(len(rows)),  # the less, the likelier
                    inverse @ kernel[:, :, n_out : n_out + len(inputs)],
                    *(inverse, root, rest, free),
                )
            )
        (_, whole, inverse, root, rest, free), (_, other, *_) = (
            told[::-1] if jumps or told[1][0] < told[0][0] else told
        )
        own = np.eye(len(inputs), len(names) - n_out) + np.zeros((omega.size, 1, 1))
        by = lag[:, None, :, None] * np.concatenate([whole.swapaxes(1, 2), own], axis=2)[:, :, None]
        weight = by.reshape(omega.size, len(inputs), -1) @ (root * np.sqrt(np.pi / tick))
        noise = inverse @ (rest.T @ rest * (tick / np.pi / free)) @ inverse.conj().swapaxes(1, 2)
        response, first = np.moveaxis(whole, 0, 2), np.zeros(1, dtype=np.intp)
        still = np.zeros(response.shape)
        scatter = LocalScatter(
            frequency=omega,
            weights=tuple(
                LineWeights(first, first, one[None, :, None]) for one in weight.astype(np.complex64)
            ),
            share=still[None] + 1.0,
            noise=noise,
            bias=still,
            spread=still,
            gap=response - np.moveaxis(other, 0, 2),
        )
        level, power = (
            np.real(np.diagonal(one, axis1=1, axis2=2)).T for one in (noise, self.spectra(outputs))
        )
        return Estimate.stated(
            response, still + 1.0, np.clip(1.0 - level / power, 0.0, 1.0), scatter
        )
