"""Progress in time: which fraction of a run's time has passed, and how many seconds are left.

A worker's own fraction counts steps: the solver takes two thirds of it whether the maps are large
or small. Here the fractions at which its stages begin are mapped to the seconds that the stages
took when they were measured (two cores, photos of 2,400 pixels). With t(f) those seconds until the
fraction f, T their sum, and e the seconds since the start, the share is t(f) / T, and e (T - t) / t
are left. While a stage reports nothing, t grows with the time, to at most four fifths of the stage.

Several objects of a photo are found first, so their number n is known a time b after the start. The
k-th one has a fraction f of its own: t = (k - 1) T + t(f) of n T are over, and (n T - t) (e - b +
c) / (t + c) are left, with c two seconds at the usual speed. The share is that of e in the sum of
both.

Limits: objects count alike, whatever their size. The time of the solver depends on the photo, by a
factor of three either way; the estimate corrects itself once the solver is done. Nothing is said
about the first two seconds.
"""

from bisect import bisect_right
from dataclasses import dataclass, field, replace

from .process import WorkerUpdate

# Fractions at which loading, separation, solver, relief and writing begin, and the end; and where
# the gloss is refined after the relief.
_FRACTIONS = (0.0, 0.024, 0.064, 0.736, 0.8, 1.0)
_REFINED_FRACTIONS = (0.0, 0.021, 0.056, 0.644, 0.7, 0.8, 1.0)
# Seconds of these stages by the longer side of the maps.
_SECONDS = {
    256: (2.0, 1.5, 3.5, 0.4, 1.5),
    512: (2.0, 1.7, 3.5, 1.3, 2.4),
    1024: (2.3, 3.0, 3.5, 6.2, 6.0),
    2048: (2.3, 4.5, 5.0, 7.0, 17.5),
}
_REFINING_SECONDS = 8.0  # at any size; next to nothing where there are no highlights
_UNSURE_SECONDS = 2.0
_MAX_UNREPORTED = 0.8  # share of a stage's rest


@dataclass
class Pace:
    """The time of one run.

    Attributes
    ----------
    size : int
        Longer side of the maps; 0 is that of the photo.
    refine : bool
        Whether the gloss is refined.
    several : bool
        Whether the worker looks for several objects.
    share : float
        Fraction of the time that has passed, in [0, 1]; never decreases.
    """

    size: int
    refine: bool = False
    several: bool = False
    share: float = field(default=0.0, init=False)
    _fraction: float = field(default=-1.0, init=False)
    _since: float = field(default=0.0, init=False)
    _begun: float | None = field(default=None, init=False)

    def at(self, update: WorkerUpdate, elapsed: float) -> WorkerUpdate:
        """Add the times to an update.

        Parameters
        ----------
        update : WorkerUpdate
            Of a worker that runs.
        elapsed : float
            Seconds since the worker was started.

        Returns
        -------
        WorkerUpdate
            The update with the share of the time for its fraction, and the seconds left.
        """
        if self.several and update.part is None:  # how many objects there are is not yet known
            return replace(update, fraction=self.share)
        if self._begun is None:
            self._begun = elapsed if self.several else 0.0
        spent, usual = elapsed - self._begun, _UNSURE_SECONDS if self.several else 0.0
        done, end, total = self._seconds(update)
        if update.fraction != self._fraction:
            self._fraction, self._since = update.fraction, elapsed
        slowness = max(1.0, spent / done) if done > 0 else 1.0
        waited = min((elapsed - self._since) / slowness, _MAX_UNREPORTED * (end - done))
        if (over := done + waited) > 0 or usual:
            left = (total - over) * (spent + usual) / (over + usual)
            self.share = max(self.share, elapsed / (elapsed + left))
        left = elapsed * (1 - self.share) / self.share if self.share > 0 else 0.0
        sure = min(spent, done) >= _UNSURE_SECONDS
        return replace(update, fraction=self.share, seconds_left=left if sure else None)

    def _seconds(self, update: WorkerUpdate) -> tuple[float, float, float]:
        """Measured seconds until a fraction of the worker's, until its stage ends, in total."""
        if update.part is None:
            return self._seconds_of_one(update.fraction)
        number, count = update.part
        fraction = min(max(update.fraction * count - (number - 1), 0.0), 1.0)
        done, end, total = self._seconds_of_one(fraction)
        before = (number - 1) * total
        return before + done, before + end, count * total

    def _seconds_of_one(self, fraction: float) -> tuple[float, float, float]:
        size = min(_SECONDS, key=lambda size: abs(size - (self.size or max(_SECONDS))))
        stages: tuple[float, ...] = _SECONDS[size]
        fractions: tuple[float, ...] = _FRACTIONS
        if self.refine:
            stages, fractions = (*stages[:4], _REFINING_SECONDS, stages[4]), _REFINED_FRACTIONS
        stage = min(bisect_right(fractions, max(fraction, 0.0)), len(stages)) - 1
        start, end = fractions[stage : stage + 2]
        part = min((fraction - start) / (end - start), 1.0)
        before = sum(stages[:stage])
        return before + part * stages[stage], before + stages[stage], sum(stages)
