"""The port of a simulated machine's daemon: the configured one, for one simulated machine at a time."""

from __future__ import annotations

import socket

from compd.simulation.wires.tcp_port import ANY, LOOPBACK, claimed_port
from tests.support.ports import free_port


def test_the_configured_port_is_kept() -> None:
    port = free_port()
    with claimed_port(port) as claimed:
        assert claimed == port


def test_a_port_that_a_daemon_uses_is_exchanged_for_any() -> None:
    with socket.create_server((LOOPBACK, 0)) as taken, claimed_port(taken.getsockname()[1]) as claimed:
        assert claimed == ANY


def test_a_second_simulator_takes_another_before_the_first_ones_daemon_runs() -> None:
    port = free_port()
    with claimed_port(port) as first, claimed_port(port) as second:
        assert (first, second) == (port, ANY)
    with claimed_port(port) as later:
        assert later == port
