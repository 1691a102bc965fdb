"""Modbus TCP, by pymodbus: its transaction numbers keep a late reply from being taken for the next one.

After any fault but the device's own exception the connection is closed, and the next request opens a new one, in which
nothing of an old reply can be left. pymodbus reports a timeout by ModbusIOException, a lost connection by
ConnectionException, a device's exception by returning ExceptionResponse.
"""

from __future__ import annotations

import logging
import math
import struct
import threading
from collections.abc import Callable, Mapping, Sequence

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException
from pymodbus.pdu import ExceptionResponse, ModbusPDU

from compd.clock import Clock
from compd.gauge import LineFault, Quality, RegisterReply
from compd.lines.modbus_serial import WRITE_COIL, WRITE_REGISTER, WRITE_REGISTERS, exception_fault

# Every fault becomes a LineFault and reaches STATUS; pymodbus would log each one as well.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())
logging.getLogger("pymodbus").propagate = False


class ModbusTcp:
    """A `RegisterLine` over Modbus TCP. Used by one thread."""

    last_request_s = -math.inf  # not noted: a reply names its request
    unexpected_bytes = 0  # pymodbus drops them by their transaction number, uncounted
    request_came_back = False  # TCP has no echo

    def __init__(self, host: str, port: int, timeout_s: float, clock: Clock, pause_s: float = 0.0) -> None:
        """Connect within `timeout_s`. `pause_s`: from a reply to the next request, s.

        Raises LineFault (LINE_LOST) when the device cannot be reached.
        """
        self._where = f"{host}:{port}"
        self._timeout_s = timeout_s
        self._clock = clock
        self._pause_s = pause_s
        self._last_reply_s = -math.inf
        self._no_event = threading.Event()  # never set: the clock waits for it to pause
        self._client = ModbusTcpClient(host, port=port, timeout=timeout_s, retries=0)
        self._connect()

    def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` registers from `address` of slave `unit` by function 3 or 4.

        Raises LineFault: TIMEOUT, MISMATCH, DEVICE_ERROR (with the exception's name), LINE_LOST.
        """
        read = self._client.read_holding_registers if function == 3 else self._client.read_input_registers
        time_s, reply = self._asked(function, lambda: read(address, count=count, device_id=unit))
        if len(reply.registers) != count:
            raise self._fault(Quality.MISMATCH, f"asked {count} registers, got {len(reply.registers)}")
        return RegisterReply(tuple(reply.registers), time_s)

    def read_bits(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` bits from `address` of slave `unit` by function 1 or 2. Raises LineFault as `read_registers` does."""
        read = self._client.read_coils if function == 1 else self._client.read_discrete_inputs
        time_s, reply = self._asked(function, lambda: read(address, count=count, device_id=unit))
        if len(reply.bits) != 8 * -(-count // 8):  # whole bytes
            raise self._fault(Quality.MISMATCH, f"asked {count} bits, got {len(reply.bits)}")
        return RegisterReply(tuple(map(int, reply.bits[:count])), time_s)

    def write(self, unit: int, function: int, address: int, values: Sequence[int], settle_s: float = 0.0) -> float:
        """Write by function 5, 6 or 16; see `RegisterLine`. Over TCP unit 0 is a device like any other.

        Raises LineFault as `read_registers` does.
        """
        client = self._client
        first = values[0]
        writes: Mapping[int, Callable[[], ModbusPDU]] = {
            WRITE_COIL: lambda: client.write_coil(address, bool(first), device_id=unit),
            WRITE_REGISTER: lambda: client.write_register(address, first, device_id=unit),
            WRITE_REGISTERS: lambda: client.write_registers(address, list(values), device_id=unit),
        }
        time_s, reply = self._asked(function, writes[function])
        confirmed = {
            WRITE_COIL: list(map(int, reply.bits[:1])) == [int(bool(first))],
            WRITE_REGISTER: list(reply.registers) == [first],
            WRITE_REGISTERS: reply.count == len(values),
        }
        if reply.address != address or not confirmed[function]:
            raise self._fault(Quality.MISMATCH, f"wrote {list(values)} to {address}, something else was confirmed")
        self._wait_until(time_s + settle_s)
        return time_s

    def drain(self, quiet_s: float | None = None) -> bytes:
        """Nothing: after a fault the connection is a new one."""
        return b""

    def close(self) -> None:
        """Close the connection."""
        self._client.close()  # type: ignore[no-untyped-call]

    def _wait_until(self, time_s: float) -> None:
        rest_s = time_s - self._clock.monotonic()
        if rest_s > 0:
            self._clock.wait(self._no_event, rest_s)

    def _connect(self) -> None:
        if not self._client.connect():  # type: ignore[no-untyped-call]
            raise LineFault(Quality.LINE_LOST, f"cannot connect to {self._where}")

    def _asked(self, function: int, ask: Callable[[], ModbusPDU]) -> tuple[float, ModbusPDU]:
        """One exchange: its time, s, and a reply of the same function. Raises LineFault for any other."""
        if not self._client.connected:
            self._connect()
        self._wait_until(self._last_reply_s + self._pause_s)
        time_s = self._clock.monotonic()
        try:
            reply = ask()
        except ConnectionException as error:
            raise self._fault(Quality.LINE_LOST, str(error)) from error
        except ModbusIOException as error:
            raise self._fault(Quality.TIMEOUT, f"no answer to this request within {self._timeout_s:g} s") from error
        except (ModbusException, struct.error, IndexError, ValueError) as error:
            raise self._fault(Quality.MISMATCH, f"not to be decoded: {error}") from error
        except OSError as error:
            raise self._fault(Quality.LINE_LOST, str(error)) from error
        self._last_reply_s = self._clock.monotonic()
        if isinstance(reply, ExceptionResponse):
            raise exception_fault(reply.exception_code)
        if reply.function_code != function:
            raise self._fault(Quality.MISMATCH, f"asked function {function}, got {reply.function_code}")
        return time_s, reply

    def _fault(self, quality: Quality, detail: str) -> LineFault:
        """Close the connection, and make the fault to raise."""
        self.close()
        return LineFault(quality, detail)
