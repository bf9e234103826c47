"""Frequency responses from the best prediction of each sample by all before it, without reference.

With y(t) = K_y y + K_u u + e(t) over lags, by least squares, H = (1 - K_y)^-1 K_u (L. Ljung, System
Identification: Theory for the User, 2nd ed., 1999, ch. 7 and 13). What a gust brings at t can't
have come back into u before t: feedback by a law, or by a pilot who answers gusts, biases nothing
as long as the lags are enough to foresee gusts. Lags are single ones, then means over wider ones.

H is the response to small motion: what a servo at its limit of speed, or a tail whose thrust isn't
as its pitch, does beside is predicted by powers over short lags, of each input's speed (the cube)
and of its size (square and cube). One after the other is taken, the best first, where that predicts
better by more than chance (G. Schwarz, Ann. Statist. 6, 1978): where nothing is at a limit, powers
take jumps, which tell most, for one. No such limit is a power: what the last one that is taken
moves the response by, or the best one if none is, is one more error. Accelerations answer a jump at
once, wherever it lies between two samples here, which cubes would take for a limit: theirs is
without powers. What rounding in a log's whole steps adds to lags is taken off their squares, else
every gain is too small (W. A. Fuller, Measurement Error Models, 1987, ch. 2).
"""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.ident.local import Local
from helisim.ident.scatter import Estimate, LineWeights, LocalScatter
from helisim.records.record import ACCELERATIONS, FlightRecord

# rad of the band's top between samples, where accelerations answer; of its lower edge in all lags
_TICK, _AT_ONCE, _MEMORY = 0.45, 0.3, 4.0
# Lags until their means grow wider, by a factor of e in as many; s, for which a servo may be late
_SINGLE, _SLEWS = 8.0, 0.12
# _FRESH: over 1, the share of samples that differ from the one before: then rounding errors do, too
# _MATTERS: share of a lag's square: taking off less would cost more by the numbers' own rounding
_FRESH, _MATTERS = 3.0, 1e-9


class Predictor(Local):
    """Records, for responses to inputs at (n_freq,) rad/s; a reference adds nothing."""

    def estimate(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        reference: Sequence[str] = (),
    ) -> Estimate:
        """Return the responses with their errors."""
        names, n_out, omega = (*outputs, *inputs), len(outputs), self._frequency
        longest = max(one.sample_time for one in self._records)
        jumps = bool({*outputs} & {*ACCELERATIONS})
        tick = max(round((_AT_ONCE if jumps else _TICK) / (omega[-1] * longest)), 1) * longest
        count = np.arange(_SINGLE * np.arcsinh(_MEMORY / (omega[0] * tick * _SINGLE)) + 1.0)
        edges = np.rint(_SINGLE * np.sinh(count / _SINGLE)).astype(np.intp)
        wide, short = np.diff(edges), int(np.sum(edges * tick <= _SLEWS))
        parts = [_lagged(one, names, n_out, tick, edges, short) for one in self._records]
        samples, linear = sum(map(len, parts)), wide.size * len(names)
        upper = np.asarray(np.linalg.qr(np.concatenate(parts), mode="r"))  # all that is needed
        means = sum(len(part) * one.sample_time for part, one in zip(parts, self._records)) / tick
        less = np.outer(means / wide, _rounding(self._records, names)).ravel()
        if np.max(less / np.sum(upper[:, :linear] ** 2, axis=0)) > _MATTERS:
            with suppress(np.linalg.LinAlgError):  # of what hardly moves beside its rounding
                square = upper.T @ upper - np.diag(np.pad(less, (0, upper.shape[1] - linear)))
                upper = np.linalg.cholesky(square).T
        columns, now = np.split(np.arange(upper.shape[1]), [-n_out])

        def told(*powers: NDArray[np.intp]) -> tuple[float, Real, Real]:
            """Return a criterion, the less the likelier, and the triangle of some powers."""
            some = np.concatenate([columns[:linear], *powers])
            own = np.asarray(np.linalg.qr(upper[:, [*some, *now]], mode="r"))
            rest = own[some.size :, some.size :]
            return (
                samples * np.linalg.slogdet(rest.T @ rest)[1] + n_out * some.size * np.log(samples),
                *(own[:, : some.size], own[:, some.size :]),
            )

        cubes, *sizes = columns[linear:].reshape(-1, 3, len(names) - n_out).transpose(1, 2, 0)
        path, chosen, left = [told()], list[NDArray[np.intp]](), [*cubes, *np.hstack(sizes)]
        while left and not jumps and samples > upper.shape[1]:
            more = [told(*chosen, one) for one in left]
            best = min(range(len(left)), key=lambda k: more[k][0])
            if more[best][0] >= path[-1][0]:
                path.insert(0, more[best])
                break
            path.append(more[best])
            chosen.append(left.pop(best))
        turned = np.exp(-1j * tick * np.outer(omega, edges + 1))
        lag = -np.diff(turned, axis=1) / np.outer(1.0 - np.exp(-1j * tick * omega), wide)

        def solved(known: Real, last: Real) -> tuple[Complex, Complex, Real, Real]:
            """Return responses, (n_freq, n_out, n_in), what a triangle leaves, and its root."""
            unit = 1.0 / (np.linalg.norm(known, axis=0) + 1e-300)
            turned, size, right = np.linalg.svd(known * unit, full_matrices=False)
            root = (unit[:, None] * right.T / np.maximum(size, 1e-9 * size[0]))[:linear]
            seen = turned.T @ last
            kernel = np.einsum("fw,wso->fos", lag, (root @ seen).reshape(-1, len(names), n_out))
            inverse = np.linalg.inv(np.eye(n_out) - kernel[:, :, :n_out])
            whole = inverse @ kernel[:, :, n_out:]
            return whole, inverse, root, last - turned @ seen

        (other, *_), (whole, inverse, root, rest) = (solved(*one[1:]) for one in (path * 2)[-2:])
        own = np.tile(np.eye(len(inputs)), (omega.size, 1, 1))
        by = lag[:, None, :, None] * np.concatenate([whole.swapaxes(1, 2), own], axis=2)[:, :, None]
        weight = by.reshape(omega.size, len(inputs), -1) @ (root * np.sqrt(np.pi / tick))
        noise = (
            inverse
            @ (rest.T @ rest * (tick / np.pi / (samples - path[-1][1].shape[1])))
            @ inverse.conj().swapaxes(1, 2)
        )
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


def _lagged(
    one: FlightRecord,
    names: Sequence[str],
    n_out: int,
    tick: float,
    edges: NDArray[np.intp],
    short: int,
) -> Real:
    """Return rows, (n_sample, n_column): lags, powers' by the first `short` edges, and outputs."""
    size = max(round(tick / one.sample_time), 1)
    values = one.select(names)[: len(one) // size * size].reshape(-1, size, len(names))
    mean = values.mean(axis=1) - values.mean(axis=(0, 1))
    moved, at = mean[:, n_out:], np.arange(edges[-1], len(mean))
    powers = np.diff(moved, axis=0, prepend=moved[:1]) ** 3, moved**2, moved**3
    lags = (
        -np.diff(total[at[:, None] - ends], axis=1) / np.diff(ends)[:, None]
        for some, ends in ((mean, edges), (np.hstack(powers), edges[:short]))
        for total in [np.cumsum(np.pad(some, ((1, 0), (0, 0))), axis=0)]
    )
    return np.hstack([*(each.reshape(at.size, -1) for each in lags), mean[at, :n_out]])


def _rounding(records: Sequence[FlightRecord], names: Sequence[str]) -> Real:
    """Return the variance that rounding to whole steps adds to each signal, new in each sample."""
    apart = np.concatenate([np.diff(one.select(names), axis=0) for one in records])
    step = np.min(np.abs(apart), axis=0, where=apart != 0.0, initial=np.max(np.abs(apart)))
    return step**2 / 12.0 * np.minimum(_FRESH * np.mean(apart != 0.0, axis=0), 1.0)
