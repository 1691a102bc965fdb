"""Two names of one gateway in a configuration."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.cli.start.check import print_lines
from compd.commissioning.shared_addresses import shared_address_warnings
from compd.configuration import Configuration, load
from tests.support.paths import CONFIG


def with_second_cabinet(directory: Path, host: str, port: int = 502) -> Configuration:
    """The shipped tripod with its cabinet at 127.0.0.1, and another line of that kind."""
    text = (CONFIG / "tripod-cmm.yaml").read_text()
    second = f"  other: {{kind: modbus_tcp, host: '{host}', port: {port}, timeout_s: 0.3}}\n"
    text = text.replace("192.168.10.20", "127.0.0.1").replace("  cabinet:  ", f"{second}  cabinet:  ", 1)
    path = directory / "machine.yaml"
    path.write_text(text)
    return load(path)


def test_another_name_of_one_address_is_warned_of_with_its_place(tmp_path: Path) -> None:
    configuration = with_second_cabinet(tmp_path, "127.1")  # resolved without a name server
    (warning,) = shared_address_warnings(configuration)
    assert "lines.cabinet.host" in warning.where
    assert "same address as `127.1` of line `other`" in warning.what
    assert warning in print_lines(configuration)


@pytest.mark.parametrize(
    ("host", "port"),
    [("127.0.0.2", 502), ("127.1", 1502), ("nowhere.invalid", 502), ("not..a.name", 502)],
)
def test_other_addresses_other_ports_and_names_without_an_address_are_not(tmp_path: Path, host: str, port: int) -> None:
    assert shared_address_warnings(with_second_cabinet(tmp_path, host, port)) == []
