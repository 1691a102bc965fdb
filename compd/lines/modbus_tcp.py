"""Modbus TCP, by pymodbus: its transaction numbers keep a late reply from passing for the next one.

After any fault but the device's own exception the connection is closed and made anew: nothing of an old
reply can be left in it. pymodbus reports a timeout by ModbusIOException, a lost connection by
ConnectionException, a device's exception by returning ExceptionResponse.
"""

from __future__ import annotations

import logging
import struct

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException
from pymodbus.pdu import ExceptionResponse, ModbusPDU

from compd.clock import Clock
from compd.gauge import LineFault, Quality, RegisterReply
from compd.lines.modbus_rtu import EXCEPTIONS

# Every fault has a name here and reaches the status; pymodbus would print each one besides.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())
logging.getLogger("pymodbus").propagate = False


class ModbusTcp:
    """`RegisterLine` over Modbus TCP. One thread uses it."""

    unexpected_bytes = 0  # pymodbus drops them by their transaction number and does not count

    def __init__(self, host: str, port: int, timeout_s: float, clock: Clock) -> None:
        """Connect within `timeout_s`; LineFault(LINE_LOST) if the device cannot be reached."""
        self._where = f"{host}:{port}"
        self._timeout_s = timeout_s
        self._clock = clock
        self._client = ModbusTcpClient(host, port=port, timeout=timeout_s, retries=0)
        self._connect()

    def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` registers from `address` of slave `unit` by function 3 or 4.

        Raises LineFault: TIMEOUT, MISMATCH, DEVICE_ERROR (the exception's name), LINE_LOST.
        """
        if not self._client.connected:
            self._connect()
        ask = self._client.read_holding_registers if function == 3 else self._client.read_input_registers
        time_s = self._clock.monotonic()
        try:
            reply = ask(address, count=count, device_id=unit)
        except ConnectionException as error:
            raise self._fault(Quality.LINE_LOST, str(error)) from error
        except ModbusIOException as error:
            raise self._fault(Quality.TIMEOUT, f"no answer to this request within {self._timeout_s:g} s") from error
        except (ModbusException, struct.error, IndexError, ValueError) as error:
            raise self._fault(Quality.MISMATCH, f"not to be decoded: {error}") from error
        except OSError as error:
            raise self._fault(Quality.LINE_LOST, str(error)) from error
        return RegisterReply(self._checked(reply, function, count), time_s)

    def drain(self) -> bytes:
        """After a fault nothing is left to drain: the connection is new."""
        return b""

    def close(self) -> None:
        """Close the connection."""
        self._client.close()  # type: ignore[no-untyped-call]

    def _connect(self) -> None:
        if not self._client.connect():  # type: ignore[no-untyped-call]
            raise LineFault(Quality.LINE_LOST, f"cannot connect to {self._where}")

    def _checked(self, reply: ModbusPDU, function: int, count: int) -> tuple[int, ...]:
        if isinstance(reply, ExceptionResponse):
            code = reply.exception_code
            raise LineFault(Quality.DEVICE_ERROR, f"exception {code}, {EXCEPTIONS.get(code, 'unknown')}")
        if reply.function_code != function:
            raise self._fault(Quality.MISMATCH, f"asked function {function}, got {reply.function_code}")
        if len(reply.registers) != count:
            raise self._fault(Quality.MISMATCH, f"asked {count} registers, got {len(reply.registers)}")
        return tuple(reply.registers)

    def _fault(self, quality: Quality, detail: str) -> LineFault:
        self.close()
        return LineFault(quality, detail)
