"""Control of the lens by the scene's distance, the twin of ``rtl/actuators/focus_control.sv``.

VR-SCAN IV-E: a piezo motor and a magnetic position sensor, here on one I2C bus.
"""

from vrscan.clocked import focus_filter, focus_target
from vrscan.clocked.focus_filter import FocusFilter
from vrscan.clocked.focus_motor import FocusMotor
from vrscan.clocked.focus_target import FocusTarget
from vrscan.clocked.i2c_master import I2cMaster
from vrscan.clocked.m3_motor import M3Motor
from vrscan.registers.settings import FocusSettings

DISTANCE_LATENCY = focus_filter.LATENCY  # clocks from valid to the distance
# Clocks from valid to the target; points that come sooner are ignored.
TARGET_LATENCY = DISTANCE_LATENCY + focus_target.LATENCY


class FocusControl:
    """Clock-accurate control with its bus master. A new one is in the state after a reset.

    Args:
        settings: The configuration ports; ``configure`` changes them between two steps.
        count_width: Bits of the counters, ``CountWidth``.

    Attributes:
        filter, lens, motor, m3, master: The twins of the parts; ``lens`` chooses its target. Their
            outputs are the control's.
    """

    def __init__(self, settings: FocusSettings, count_width: int = 16) -> None:
        self.filter = FocusFilter(settings)
        self.lens = FocusTarget(settings)
        self.motor = FocusMotor(settings, count_width)
        self.m3 = M3Motor()
        self.master = I2cMaster(count_width)
        self.configure(settings)

    def configure(self, settings: FocusSettings) -> None:
        """Change the configuration."""
        self._settings = settings
        self.filter.settings = self.lens.settings = self.motor.settings = settings

    def step(
        self,
        *,
        valid: bool,
        measured: bool,
        flags: int,
        test: bool,
        z: int,
        scl: bool,
        sda: bool,
        table_write: bool = False,
        table_index: int = 0,
        table_position: int = 0,
    ) -> None:
        """Advance by one clock with these inputs and levels of the pins."""
        settings, lens, motor, master = self._settings, self.lens, self.motor, self.master
        m3 = self.m3
        # Each part sees the outputs of the others from the previous clock.
        busy = lens.busy
        bus_valid, bus_status, bus_data = master.valid, master.status, master.data
        byte_valid, read_byte = master.byte_valid, master.byte
        through_m3 = bool(settings.protocol)
        if m3.valid:
            reply_valid, reply_status, reply_data = True, m3.status, m3.position
        else:
            reply_valid = bus_valid and not m3.busy
            reply_status, reply_data = int(bus_status), bus_data & 0xFFFF
        master.step(
            valid=m3.command_valid or (motor.command_valid and not through_m3),
            read=m3.command_read if m3.busy else motor.command_read,
            address=settings.address,
            register=motor.command_register,
            bytes=1,
            data=motor.command_data,
            scl=scl,
            sda=sda,
            quarter=settings.quarter_clks,
            timeout=settings.stretch_clks,
            stream=m3.busy,
            byte=m3.byte or 0,
            last=m3.last,
        )
        m3.step(
            valid=motor.command_valid and through_m3,
            read=motor.command_read,
            target=motor.command_data,
            byte_valid=byte_valid,
            byte=read_byte,
            reply_valid=bus_valid,
            reply_status=bus_status,
        )
        motor.step(
            target=lens.target,
            known=lens.known,
            reply_valid=reply_valid,
            reply_status=reply_status,
            reply_data=reply_data,
        )
        lens.step(
            valid=self.filter.valid,
            distance=self.filter.distance,
            lapse=self.filter.lapse,
            table_write=table_write,
            table_index=table_index,
            table_position=table_position,
        )
        self.filter.step(valid=valid, measured=measured, flags=flags, test=test, z=z, busy=busy)
