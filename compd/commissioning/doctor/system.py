"""Checks of real time, clock, disk, the daemon's own sockets and its unit."""

from __future__ import annotations

import os
import resource
import shutil
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from compd.probes import Computer, Finding, advice, fault, good, unknown

# linux/capability.h
_CAP_IPC_LOCK, _CAP_SYS_NICE = 14, 23
_UNIT = "compd"
# Least free space (bytes): a recording takes 100 to 200 MB an hour with its cycles, machine zero a few kB.
_LITTLE_BYTES, _SCARCE_BYTES = 100e6, 2e9
_COARSE_S = 1e-6
_LISTENING = "0A"  # net/tcp_states.h


_RULES = "install systemd/compd.rules, or set loop.wake_latency_us to 100000 to do without"
_LIMITS = "run the daemon by systemd/compd.service, or give its user rtprio 98 and memlock unlimited in limits.conf(5)"


def realtime_findings(computer: Computer, priority: int, granted: Mapping[str, Any]) -> Iterator[Finding]:
    """Real-time permissions of the loop. granted : those of the running daemon from STATUS; {} without a daemon."""
    yield from _granted_findings(granted) if granted else _permitted_findings(computer, priority)
    yield _kernel_finding(computer)
    runtime = computer.read("/proc/sys/kernel/sched_rt_runtime_us")
    if runtime == "-1":
        yield advice(
            "real time",
            "throttling is off: a thread with priority that never sleeps stops the computer",
            "sysctl kernel.sched_rt_runtime_us=950000",
        )
    elif runtime is not None:
        yield good("real time", f"all threads with priority may take {int(runtime) / 1e4:.0f} % of the processors")
    cpus = computer.path("/sys/devices/system/cpu").glob("cpu*/cpufreq/scaling_governor")
    if any(path.read_text(encoding="ascii").strip() == "powersave" for path in cpus):
        yield advice(
            "real time",
            "the processors save power (governor powersave): a cycle takes longer, and varies",
            "cpupower frequency-set --governor performance",
        )


def _granted_findings(granted: Mapping[str, Any]) -> Iterator[Finding]:
    """Permissions of a running daemon."""
    for name, next_step in (("sched_fifo", _LIMITS), ("locked_memory", _LIMITS), ("wake_latency", _RULES)):
        permission = granted.get(name)
        if permission is None:
            continue
        if permission["granted"]:
            yield good("real time", f"the running daemon has {name}: {permission['detail']}")
        else:
            yield advice("real time", f"the running daemon has no {name}: {permission['detail']}", next_step)


def _permitted_findings(computer: Computer, priority: int) -> Iterator[Finding]:
    """Permissions of this user, without a running daemon."""
    capabilities = int(_status_of_self(computer).get("CapEff", "0"), 16)
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    if capabilities >> _CAP_SYS_NICE & 1 or limit == resource.RLIM_INFINITY or limit >= priority:
        yield good("real time", f"this user may have priority {priority} (SCHED_FIFO)")
    else:
        yield advice("real time", f"this user may have no priority {priority}: RTPRIO is {limit}", _LIMITS)
    memory = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if capabilities >> _CAP_IPC_LOCK & 1 or memory == resource.RLIM_INFINITY:
        yield good("real time", "this user may lock memory")
    else:
        yield advice("real time", f"this user may lock {memory / 1e6:.3g} MB of memory only", _LIMITS)


def _kernel_finding(computer: Computer) -> Finding:
    version = computer.read("/proc/version") or ""
    if computer.read("/sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        return good("real time", "the kernel is PREEMPT_RT")
    if "PREEMPT" in version:
        model = "PREEMPT_DYNAMIC" if "PREEMPT_DYNAMIC" in version else "PREEMPT"
        return good(
            "real time", f"the kernel is {model}: late by tenths of a millisecond at times; PREEMPT_RT is better"
        )
    return advice(
        "real time",
        "the kernel does not preempt itself: cycles may be late by milliseconds",
        "install a kernel with PREEMPT_RT",
    )


def clock_findings(computer: Computer) -> Iterator[Finding]:
    """Synchronisation and resolution of the clock."""
    resolution_s = time.get_clock_info("monotonic").resolution
    if resolution_s > _COARSE_S:
        yield fault(
            "clock", f"the monotonic clock has steps of {resolution_s:g} s", "use a kernel with high-resolution timers"
        )
    else:
        yield good("clock", f"the monotonic clock has steps of {resolution_s * 1e9:g} ns")
    source = computer.read("/sys/devices/system/clocksource/clocksource0/current_clocksource")
    if source in ("hpet", "acpi_pm", "jiffies", "refined-jiffies"):
        yield advice(
            "clock", f"the kernel reads a slow clock ({source})", "see `dmesg | grep -i tsc` for why it is not the tsc"
        )
    synchronised = computer.run(["timedatectl", "show", "--property=NTPSynchronized", "--value"])
    if synchronised == "yes":
        yield good("clock", "the time of day is synchronised")
    elif synchronised == "no":
        yield advice(
            "clock",
            "the time of day is not synchronised: recordings could not be joined with those of others",
            "timedatectl set-ntp true",
        )
    else:
        yield unknown("clock", "it is unknown here whether the time of day is synchronised")


def disk_findings(computer: Computer, directory: Path) -> Iterator[Finding]:
    """The state directory: permission for machine zero, and free space."""
    subject = "disk"
    existing = next(place for place in (directory, *directory.parents) if computer.path(place).exists())
    if not os.access(computer.path(existing), os.W_OK | os.X_OK):
        step = f"as root: install -d -o USER {directory}; USER is who runs the daemon"
        yield fault(subject, f"{directory} cannot be written by this user: no machine zero can be taken", step)
    free = shutil.disk_usage(computer.path(existing)).free
    if free < _LITTLE_BYTES:
        yield fault(subject, f"{free / 1e6:.0f} MB are free at {existing}", f"make room at {existing}")
    elif free < _SCARCE_BYTES:
        yield advice(
            subject, f"{free / 1e9:.1f} GB are free at {existing}: some hours of recordings", f"make room at {existing}"
        )
    else:
        yield good(subject, f"{free / 1e9:.0f} GB are free at {existing}")


def tcp_finding(computer: Computer, port: int, daemon_runs: bool) -> Finding:
    """The TCP port of the daemon: is it free, or the daemon's own?"""
    subject = f"TCP port {port}"
    inodes = _listeners(computer, port)
    if not inodes:
        if daemon_runs:
            return unknown(
                subject,
                "the running daemon does not listen on it: it has another configuration",
                "compd run or reload it with this one",
            )
        return good(subject, "is free")
    if daemon_runs:
        return good(subject, "the running daemon listens on it")
    return fault(
        subject,
        "another process listens on it",
        f"end that process (as root: ss -ltnp 'sport = :{port}'), or choose another port",
    )


def unit_finding(computer: Computer, daemon_runs: bool) -> Finding:
    """The systemd unit, if there is one."""
    shown = computer.run(
        ["systemctl", "show", _UNIT, "--property=LoadState,ActiveState,SubState,NRestarts,UnitFileState"]
    )
    if shown is None:
        return unknown("service", "systemd does not run here")
    unit = dict(line.split("=", 1) for line in shown.splitlines() if "=" in line)
    if unit.get("LoadState") != "loaded":
        return unknown("service", f"there is no unit {_UNIT}: nothing starts the daemon with the computer")
    state = f"{unit.get('ActiveState')} ({unit.get('SubState')}), restarted {unit.get('NRestarts', '?')} times"
    if unit.get("ActiveState") != "active":
        return fault(
            "service",
            f"the unit {_UNIT} is {state}",
            f"journalctl --unit {_UNIT} --lines 50; then systemctl start {_UNIT}",
        )
    if unit.get("UnitFileState") == "disabled":
        return advice(
            "service", f"the unit {_UNIT} is {state}, and does not start with the computer", f"systemctl enable {_UNIT}"
        )
    if not daemon_runs:
        return advice(
            "service",
            f"the unit {_UNIT} is {state}, but has another socket than this configuration",
            "compare the files",
        )
    return good("service", f"the unit {_UNIT} is {state}")


def _listeners(computer: Computer, port: int) -> list[str]:
    """Inodes of the sockets listening on a TCP port, from /proc/net."""
    found = []
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in (computer.read(table) or "").splitlines()[1:]:
            columns = line.split()
            if len(columns) > 9 and columns[3] == _LISTENING and int(columns[1].rpartition(":")[2], 16) == port:
                found.append(columns[9])
    return found


def _status_of_self(computer: Computer) -> dict[str, str]:
    lines = (computer.read("/proc/self/status") or "").splitlines()
    return {name: value.strip() for name, _, value in (line.partition(":") for line in lines)}
