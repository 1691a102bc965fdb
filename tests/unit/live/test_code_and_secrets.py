"""What a client of the Unix socket cannot get from the daemon: a file that it may not read, and code that it brings."""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import shutil
import socket
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from compd.cli.measurements.model.adopt import adopt
from compd.client import connect
from compd.configuration.effect_files import EffectFile
from compd.errors import CompdError, DaemonError
from compd.live.daemon import Daemon
from compd.page.daemon_link import DaemonLink
from compd.page.model_files import ModelFiles
from compd.page.orders import Orders
from tests.support.live_models import file_with
from tests.support.patience import PATIENCE_S
from tests.unit.live.test_daemon import configuration, first, running, still

__all__ = ["still"]

NOBODY = 65534
SECRET = "s3cr3t-T0ken-of-the-controller"
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")


@pytest.fixture
def open_directory():
    """A directory into which other users can look."""
    directory = Path(tempfile.mkdtemp(prefix="compd-"))
    directory.chmod(0o755)
    yield directory
    shutil.rmtree(directory)


def asked_by_nobody(path: Path, *requests: tuple[dict, str | None]) -> list[str]:
    """The answers to these requests of user nobody, who is in the group of the socket.

    With a second part the request is sent with a descriptor of that file, opened with O_PATH: all that nobody can get.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        try:
            os.setgroups([])
            os.setgid(path.stat().st_gid)
            os.setuid(NOBODY)
            with socket.socket(socket.AF_UNIX) as peer:
                peer.settimeout(PATIENCE_S)
                peer.connect(str(path))
                lines = peer.makefile("rb")
                lines.readline()
                answers = []
                for request, opened in requests:
                    line = json.dumps(request).encode() + b"\n"
                    if opened is None:
                        peer.sendall(line)
                    else:
                        socket.send_fds(peer, [line], [os.open(opened, os.O_PATH)])
                    answers.append(lines.readline().decode())
            os.write(writing, json.dumps(answers).encode())
        except BaseException as error:  # noqa: BLE001  the parent tells it
            os.write(writing, json.dumps([repr(error)]).encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as answers:
        found = json.loads(answers.read())
    os.waitpid(child, 0)
    return found


@as_root
@pytest.mark.usefixtures("still")
def test_a_member_of_the_sockets_group_reads_no_file_that_only_the_daemon_may_read(open_directory, capfd):
    token = open_directory / "token"
    token.write_text(SECRET)
    token.chmod(0o600)
    configured = configuration(open_directory)
    with running(configured):
        asked = [
            ({"class": "MODEL", "file": file, "shadow": shadow}, opened)
            for file in (str(token), "/etc/shadow")
            for shadow in (False, True)
            for opened in (None, file, "/")
        ]
        answers = asked_by_nobody(Path(configured.sockets.unix.path), *asked)
    assert len(answers) == len(asked)
    secrets = [SECRET, *Path("/etc/shadow").read_text().split("\n")[:1]]
    said = "".join(answers) + "".join(capfd.readouterr())
    assert not [secret for secret in secrets if secret in said]
    for (_, opened), answer in zip(asked, map(json.loads, answers), strict=True):
        assert answer["class"] == "ERROR"
        assert answer["code"] == ("bad_message" if opened is None else "model_refused"), answer
    assert f"unix, user {NOBODY}" in said, "the log tells who has asked"


OWN = """\
from dataclasses import replace
from pathlib import Path
from compd.model.library.link import EFFECTS
Path("{marker}").touch()
MINE = replace(EFFECTS[0], id="{id}")
"""


class OwnCode:
    """A Python file with an effect, a model that uses it, and a mark of every time it was executed."""

    def __init__(self, directory: Path) -> None:
        self.marker = directory / "executed"
        self.file = directory / "mine.py"
        self.write("mine")
        self.model = file_with(directory / "mine.model.yaml", f"{self.file}:MINE")
        self.was_executed()

    def write(self, id_: str) -> None:
        self.file.write_text(OWN.format(marker=self.marker, id=id_))
        self.file.chmod(0o644)

    @property
    def listed(self) -> tuple[EffectFile, ...]:
        return (EffectFile(file=str(self.file), sha256=hashlib.sha256(self.file.read_bytes()).hexdigest()),)

    def was_executed(self) -> bool:
        """Since the last time it was asked."""
        executed = self.marker.exists()
        self.marker.unlink(missing_ok=True)
        return executed


@pytest.fixture
def own(tmp_path):
    return OwnCode(tmp_path)


@pytest.mark.usefixtures("still")
def test_a_file_that_is_not_listed_is_not_executed_nor_opened(tmp_path, own):
    configured = configuration(tmp_path)
    unreadable = own.file.read_bytes()
    with running(configured) as (_, client):
        own.file.unlink()
        os.mkfifo(own.file)  # to open it would wait for ever
        for shadow in (True, False):
            with pytest.raises(DaemonError, match="does not list") as caught:
                client.model(own.model, shadow=shadow)
        assert f"- {{file: {own.file}, sha256: HASH}}" in caught.value.problems[0].what
        assert f"sha256sum {own.file}" in caught.value.problems[0].what
        own.file.unlink()
        own.file.write_bytes(unreadable)
        with pytest.raises(CompdError) as caught:
            adopt(own.model, configured.sockets.unix.path)
        assert f"- {{file: {own.file}, sha256: {own.listed[0].sha256}}}" in str(caught.value), "the client knows it"
        assert client.model()["applied"] == {"effects": []}
    starting = replace(configured, state=configured.state.model_copy(update={"model_file": str(own.model)}))
    with pytest.raises(CompdError, match="does not list"):
        Daemon(starting)
    assert not own.was_executed()


@pytest.mark.usefixtures("still")
def test_a_listed_file_is_executed_and_a_changed_one_is_not(tmp_path, own):
    with running(replace(configuration(tmp_path), effects=own.listed)) as (_, client):
        assert client.model(own.model)["applied"]["effects"] == ["mine"]
        assert own.was_executed()
        client.model("")
        own.was_executed()
        listed = own.listed[0].sha256
        own.write("changed")
        with pytest.raises(DaemonError, match="another content than the configuration lists") as caught:
            client.model(own.model)
        assert listed in str(caught.value)
        assert own.listed[0].sha256 in str(caught.value)
        assert not own.was_executed()


@pytest.mark.usefixtures("still")
def test_the_shadow_is_adopted_by_its_hash_whatever_has_become_of_its_file(tmp_path):
    file = file_with(tmp_path / "m.yaml", "link_zero")
    with running(configuration(tmp_path)) as (_, client):
        client.zero()
        hash_ = client.model(file, shadow=True)["shadow"]["model"]
        assert hash_ == hashlib.sha256(file.read_bytes()).hexdigest()[:16]
        file_with(file, "link_sag")
        with pytest.raises(DaemonError, match="no model of this hash runs as the shadow"):
            client.adopt_shadow("0" * 16)
        assert client.model()["applied"] == {"effects": []}
        adopted = client.adopt_shadow(hash_)
        assert adopted["applied"] == {"effects": ["link_zero"], "model": hash_, "file": str(file)}
        assert "shadow" not in adopted
        assert first(client.watch(), "ok")["model"] == hash_
        with pytest.raises(DaemonError, match="none runs"):
            client.adopt_shadow(hash_)


@pytest.mark.usefixtures("still")
def test_a_running_daemon_tells_a_recorder_who_ordered_what(tmp_path):
    configured = configuration(tmp_path)
    with running(configured) as (_, client), connect(configured.sockets.unix.path) as recorder:
        client.zero()
        messages = recorder.readings()
        next(messages)
        with connect(configured.sockets.unix.path, by="anna (operate) from 10.0.0.5") as other:
            other.model("")
        order = next(message for _, message in messages if message["class"] == "ORDER")
        assert (order["order"], order["subject"], order["done"]) == ("MODEL", "apply none", True)
        assert (order["client"], order["by"]) == (f"unix, user {os.getuid()}", "anna (operate) from 10.0.0.5")


@pytest.mark.usefixtures("still")
def test_a_browser_that_brings_code_and_a_model_gets_neither_run(tmp_path, own):
    """An export is written as evil.py, another as evil.yaml which names it, and the page is to run the model."""
    exports = tmp_path / "exports"
    exports.mkdir()
    evil = exports / "evil.yaml"
    evil.write_bytes(own.model.read_bytes())
    good = file_with(tmp_path / "good.model.yaml", "link_zero")
    configured = configuration(tmp_path)
    orders = Orders(DaemonLink(configured.sockets.unix.path), ModelFiles(tmp_path))
    by = "mallory (operate) from 10.0.0.9"

    def do(name, subject):
        return asyncio.run(orders.do(name, subject, by))

    with running(configured) as (_, client), connect(configured.sockets.unix.path) as recorder:
        client.zero()
        messages = recorder.readings()
        next(messages)
        for subject in (str(evil), "exports/evil.yaml", "../exports/evil.yaml", "evil.yaml", "/etc/shadow"):
            for name in ("shadow", "adopt"):
                with pytest.raises(DaemonError) as caught:
                    do(name, subject)
                assert caught.value.problems[0].where == "page", "the daemon has not been asked"
        with pytest.raises(DaemonError, match="does not list"):
            do("shadow", own.model.name)  # in the directory of models, as if somebody had put it there
        assert not own.was_executed()
        hash_ = do("shadow", good.name)["shadow"]["model"]
        good.write_bytes(own.model.read_bytes())  # what was looked at is what is adopted
        assert do("adopt", hash_)["applied"]["effects"] == ["link_zero"]
        given = []
        while len(given) < 3:
            given += [message for _, message in [next(messages)] if message["class"] == "ORDER"]
        assert [(order["subject"], order["done"], order["by"]) for order in given] == [
            (f"run as the shadow {own.model}", False, by),
            (f"run as the shadow {good}", True, by),
            (f"apply the shadow {hash_}", True, by),
        ]
    assert not own.was_executed()
