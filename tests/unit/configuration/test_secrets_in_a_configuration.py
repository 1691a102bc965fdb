"""A configuration with a secret where it does not belong: the refusal says where, and does not repeat it."""

from __future__ import annotations

import pytest
import yaml

from compd.errors import CompdError
from compd.machine_check import load_whole
from tests.support.paths import CONFIG

TRIPOD = (CONFIG / "tripod-cmm.yaml").read_text()
SECRET = "Zq7vK2xW9pLm4TnB"
MQTT = "  broker: {kind: mqtt, host: 10.0.0.9, "


@pytest.mark.parametrize(
    "line",
    [
        f"{MQTT}user: anna, password: {SECRET}}}",
        f"{MQTT}user: anna, pw: {SECRET}}}",
        f"{MQTT}user: anna, password_file: {SECRET}}}",
        f"{MQTT}user: anna, password_file: [{SECRET}]}}",
        f"{MQTT}user: anna, password_file: !!int {SECRET}}}",
        f"{MQTT}tls: {{private_key: {SECRET}}}}}",
        f"{MQTT}tls: [{{password: {SECRET}}}]}}",
        f"{MQTT}port: {{token: {SECRET}}}}}",
        f"  plc: {{kind: opc_ua, endpoint: 'opc.tcp://anna:{SECRET}@10.0.0.9:4840/'}}",
        f"  broker: {{kind: mqtt, host: 'mqtt://anna:{SECRET}@10.0.0.9', port: x}}",
    ],
)
def test_a_password_in_a_line_is_not_repeated(line: str, tmp_path) -> None:
    path = tmp_path / "machine.yaml"
    path.write_text(TRIPOD.replace("\nlines:\n", f"\nlines:\n{line}\n", 1))
    with pytest.raises(CompdError) as caught:
        load_whole(path)
    assert "machine.yaml:" in str(caught.value)
    assert SECRET not in str(caught.value)


def test_a_token_in_the_place_of_its_file_is_not_repeated(tmp_path) -> None:
    path = tmp_path / "machine.yaml"
    data = yaml.safe_load(TRIPOD)
    data["sockets"]["tcp"] |= {"token_file": SECRET, "token": SECRET}
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(CompdError) as caught:
        load_whole(path)
    assert "token_file" in str(caught.value)
    assert SECRET not in str(caught.value)
