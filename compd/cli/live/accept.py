"""`compd accept`: trust a gauge again after a person has inspected it."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, daemon_address

_TIMEOUT_S = 15.0


def accept(
    gauges: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="GAUGE...",
            help="A gauge, one channel as gauge.channel, or `all`; default: list the distrusted ones with reasons.",
        ),
    ] = None,
    daemon: DaemonOption = DEFAULT_SOCKET,
) -> None:
    """Trust a gauge again that jumped or came back with another value; inspect and reference it first."""
    from compd.client import connect

    failed = False
    with connect(daemon_address(daemon), _TIMEOUT_S) as client:
        for gauge in gauges or ():
            answer = client.accept(gauge)
            for channel, for_s in answer.get("believed_for_s", {}).items():
                typer.echo(f"{channel}: believed for {for_s:.1f} s")
            for channel, reason in answer.get("not_believed", {}).items():
                typer.echo(f"{channel}: still not believed: {reason}")
                failed = True
            if not answer["gauges"] and "not_believed" not in answer:
                typer.echo(f"{gauge}: was believed already")
        if not gauges:
            setpoint = next(client.watch())
            for line in not_believed(client.status(), setpoint):
                typer.echo(line)
    if failed:
        raise typer.Exit(1)


def not_believed(status: dict[str, Any], setpoint: dict[str, Any]) -> list[str]:
    """The distrusted gauges in STATUS and SETPOINT in words, with the command to type."""
    distrusted = [gauge for gauge in status["gauges"] if gauge["quality"] == "distrusted"]
    lines = [f"{gauge['channel']}: {gauge.get('detail', 'no reason given')}" for gauge in distrusted]
    if setpoint["state"] == "fault" and not distrusted:
        lines.append(f"fault: {setpoint['reason']}")
    if not lines:
        return ["every gauge is believed"]
    if distrusted:
        lines = [status["waits_for_person"], *lines]
    names = list(dict.fromkeys(gauge["channel"].partition(".")[0] for gauge in distrusted))
    return [*lines, "", "When you have looked at it:", *(f"    compd accept {name}" for name in [*names, "all"])]
