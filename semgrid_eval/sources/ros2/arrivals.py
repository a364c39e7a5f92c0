"""When the messages of a topic were made and recorded, and whether their clock can be trusted."""

from array import array
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError

BACK_NS = 100_000_000  # messages may overtake each other by so much
LEAP_NS = 2_000_000_000  # by which stamps may advance more than the recorder's clock: what waited arrives at once
_NS_PER_S = 1e9


@dataclass(frozen=True)
class Arrivals:
    """The messages of one topic in the order of their stamps, of equal stamps the first: all (N,)."""

    topic: str
    stamps_ns: NDArray[np.int64]
    received_ns: NDArray[np.int64]
    digests: NDArray[np.uint64]  # of their bytes; 0 where nobody asked
    repeated: int  # how many had a stamp that was there before

    def nearest(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.intp]:
        """Return the index of the message nearest to each stamp (M,) -> (M,)."""
        after = np.clip(np.searchsorted(self.stamps_ns, stamps_ns), 1, max(len(self.stamps_ns) - 1, 1))
        before = after - 1
        if len(self.stamps_ns) == 1:
            return before
        closer = stamps_ns - self.stamps_ns[before] <= self.stamps_ns[after] - stamps_ns
        return np.where(closer, before, after)


class Ledger:
    """Takes down the messages of a topic as they come."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._stamps_ns, self._received_ns, self._digests = array("q"), array("q"), array("Q")

    def add(self, stamp_ns: int, received_ns: int, digest: int = 0) -> None:
        """Take down the next message.

        Raises:
            InputError: the clock that gives the stamps has jumped.
        """
        if self._stamps_ns:
            self._require_steady(stamp_ns - self._stamps_ns[-1], received_ns - self._received_ns[-1], stamp_ns)
        self._stamps_ns.append(stamp_ns)
        self._received_ns.append(received_ns)
        self._digests.append(digest)

    def close(self) -> Arrivals:
        """Return all messages.

        Raises:
            InputError: there is none, or no message has a stamp.
        """
        if not self._stamps_ns:
            raise InputError("has no message", field=self.topic)
        stamps_ns = np.array(self._stamps_ns, np.int64)
        if not stamps_ns.any():
            message = "header stamps are all zero; `clock: received` in the map takes the recorder's instead"
            raise InputError(message, field=self.topic)
        stamps_ns, first = np.unique(stamps_ns, return_index=True)
        received_ns, digests = np.array(self._received_ns, np.int64), np.array(self._digests, np.uint64)
        repeated = len(self._stamps_ns) - len(first)
        return Arrivals(self.topic, stamps_ns, received_ns[first], digests[first], repeated)

    def _require_steady(self, step_ns: int, received_step_ns: int, stamp_ns: int) -> None:
        if step_ns < -BACK_NS or step_ns - received_step_ns > LEAP_NS:
            step_s, received_s = step_ns / _NS_PER_S, received_step_ns / _NS_PER_S
            message = (
                f"the clock of its header stamps jumps by {step_s:+.3f} s, at {stamp_ns} ns, "
                f"while the recorder's goes on by {received_s:.3f} s"
            )
            raise InputError(message, field=self.topic)
