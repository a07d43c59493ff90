"""An AXI4-Lite slave on the bus to the registers, the twin of ``rtl/axi/axil_registers.sv``."""

from collections.abc import Mapping
from typing import Literal

from vrscan.clocked.command_executor import Access
from vrscan.data import link_pkg

LATENCY = 2  # clocks from a request's ready to bus_valid_o
OKAY, SLVERR, DECERR = 0, 2, 3  # of bresp and rresp
WORD_BYTES = 4
WHOLE = 0b1111  # strobes of a whole word

Channel = Literal["aw", "w", "ar"]


def response(status: int) -> int:
    """Return the response for a status of ``link_pkg``."""
    if status == link_pkg.STATUS_OK:
        return OKAY
    return DECERR if status == link_pkg.STATUS_NO_ADDRESS else SLVERR


class AxilRegisters:
    """Clock-accurate slave. A new one is in the state after a reset.

    Attributes:
        bus: The access that begins on the bus, or None; its data are defined for a WRITE.
        write_answer: ``bresp``, or None where ``bvalid`` is low.
        read_answer: ``rresp`` and ``rdata``, or None where ``rvalid`` is low.
        refused: Status of the last access that was refused.
        refused_address: Its address, of words.
    """

    def __init__(self) -> None:
        self.bus: Access | None = None
        self.write_answer: int | None = None
        self.read_answer: tuple[int, int] | None = None
        self.refused = link_pkg.STATUS_OK
        self.refused_address = 0
        self._requests: dict[Channel, tuple[int, int]] = {}
        self._under_way: Access | None = None
        self._wrote = False  # the last access was a write

    def ready(self, channel: Channel) -> bool:
        """Return ``awready``, ``wready`` or ``arready``."""
        return channel not in self._requests

    def step(
        self,
        *,
        requests: Mapping[Channel, tuple[int, int]],
        bready: bool,
        rready: bool,
        bus_done: bool,
        bus_status: int,
        bus_data: int,
    ) -> None:
        """Advance by one clock.

        Args:
            requests: What is valid: an address and 0 of ``"aw"`` and ``"ar"``, a word and its
                strobes of ``"w"``.
            bready: ``bready``.
            rready: ``rready``.
            bus_done: Whether the bus answers.
            bus_status: Status of the answer.
            bus_data: Word of the answer.
        """
        waiting = dict(self._requests)
        idle = self._under_way is None
        write_due = idle and {"aw", "w"} <= waiting.keys() and self.write_answer is None
        read_due = idle and "ar" in waiting and self.read_answer is None
        for channel, request in requests.items():
            self._requests.setdefault(channel, request)
        if bready:
            self.write_answer = None
        if rready:
            self.read_answer = None
        self.bus = None
        if self._under_way is not None and bus_done:
            self._answer(self._under_way.address, bus_status, bus_data)
            self._under_way = None
        elif write_due and not (read_due and self._wrote):
            self._write(waiting["aw"][0] // WORD_BYTES, *waiting["w"])
        elif read_due:
            self._wrote = False
            address = waiting["ar"][0] // WORD_BYTES
            self.bus = self._under_way = Access(link_pkg.ACCESS_READ, address, 0)

    def _write(self, address: int, data: int, strobes: int) -> None:
        self._wrote = True
        if strobes == WHOLE:
            self.bus = self._under_way = Access(link_pkg.ACCESS_WRITE, address, data)
            return
        status = link_pkg.STATUS_BAD_LENGTH if strobes else link_pkg.STATUS_OK
        self._answer(address, status, 0)

    def _answer(self, address: int, status: int, data: int) -> None:
        if status != link_pkg.STATUS_OK:
            self.refused, self.refused_address = status, address
        if self._wrote:
            self.write_answer = response(status)
            del self._requests["aw"], self._requests["w"]
        else:
            self.read_answer = response(status), data
            del self._requests["ar"]
