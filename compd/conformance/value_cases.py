"""Values without faults of the wire: both signs, from one digit to the ends of the device, again and again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from compd.conformance.case_result import (
    GOOD,
    IN_VIRTUAL_TIME,
    NO_ANSWER,
    NO_NUMBER,
    NO_VALUE,
    Case,
    CaseResult,
    Subject,
    result_of,
    violations_of,
)
from compd.conformance.clock_calls import clock_calls
from compd.conformance.harness import ConformanceSession, Poll
from compd.conformance.peer import GOLDEN

LARGEST = 1e7  # in the channel's unit; above the range of every gauge
STEPS_PER_DECADE = (1.0, 2.0, 5.0)
BISECTIONS = 60  # between two steps of a decade, down to the last digit
MAX_POWERS = 32  # of 2 digits, where counters and signs roll over
MANY_EXCHANGES = 10_000
MIN_POLLS = 3000  # a driver that fails every thousandth time fails three times
WATCHED_POLLS = 300  # number of them in which no clock may be called
MAX_WITHOUT_VALUE = 0.02  # share of them: single numbers with another meaning, such as 85.0 degC of a DS18B20
SMALL_STEPS = 20


def _ends_of_range(session: ConformanceSession, _: Subject) -> CaseResult:
    violations = []
    for end in (0, 1):
        session.sensors.set_to_end(end)
        violations += violations_of(session.poll(new_values=False), GOOD)
    return result_of("range: lowest and highest value", GOOD, "ok", violations)


def _sensor_off(session: ConformanceSession, _: Subject) -> CaseResult:
    """Each sensor off in turn: it must have no number, the others only right ones."""
    observed: set[str] = set()
    violations = []
    for index, channel in enumerate(session.gauge.channels):
        session.sensors.advance()
        session.sensors.values[channel.name] = math.nan
        poll = session.poll(new_values=False)
        violations += [f"{channel.name} off: {text}" for text in poll.wrong]
        if index >= len(poll.readings):
            continue
        quality = poll.readings[index].quality
        observed.add(str(quality))
        if quality not in NO_VALUE | NO_ANSWER:
            violations.append(f"{channel.name} off: {poll}")
    violations += violations_of(session.recover()[1], GOOD)
    return result_of("a sensor is off", NO_VALUE, ", ".join(sorted(observed)), violations)


def _whole_range(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Each channel alone, from one digit to the device's largest number, both signs.

    It leaves the range in which every channel is right with the sensors.
    """
    case, required = "range: all that the device can show", "each number right to one digit, or none"
    if not subject.exact:
        return CaseResult(case, required, IN_VIRTUAL_TIME, "-")
    violations: list[str] = []
    shown = []
    for channel in session.gauge.channels:
        name = channel.name
        ends = []
        for sign in (-1.0, 1.0):
            end, wrong = _end_of(session, name, sign)
            violations += wrong
            ends.append(end)
        lowest, highest = ends
        session.sensors.whole[name] = (lowest, highest)
        for value in _special_values(session.replies.digit[name], lowest, highest):
            violations += _violations_at(session, name, value)[1]
        shown.append(f"{name} {lowest:.7g} to {highest:.7g} {channel.unit}")
    digits = ", ".join(sorted({f"{digit:.2g}" for digit in session.replies.digit.values()}))
    text = f"{'; '.join(shown)}; digit {digits}"
    result = result_of(case, GOOD | NO_NUMBER, text, violations)
    return CaseResult(case, required, result.observed, result.verdict)


def _end_of(session: ConformanceSession, channel: str, sign: float) -> tuple[float, list[str]]:
    """The largest value of this sign with a right number, and the violations up to it and beyond."""
    violations = []
    end, beyond = 0.0, math.inf
    decade = math.floor(math.log10(session.replies.digit[channel]))
    largest = round(math.log10(LARGEST))
    for value in (sign * step * 10.0**k for k in range(decade, largest) for step in STEPS_PER_DECADE):
        right, wrong = _violations_at(session, channel, value)
        violations += wrong
        if right:
            end, beyond = value, math.inf
        elif math.isinf(beyond):
            beyond = value
    for _ in range(BISECTIONS if math.isfinite(beyond) else 0):
        middle = (end + beyond) / 2
        right, wrong = _violations_at(session, channel, middle)
        violations += wrong
        end, beyond = (middle, beyond) if right else (end, middle)
        if abs(beyond - end) < session.replies.digit[channel] / 4:
            break
    return end, violations


def _violations_at(session: ConformanceSession, channel: str, value: float) -> tuple[bool, list[str]]:
    """Whether the channel has a right number for this value, with the others unchanged; and the violations."""
    session.sensors.advance()
    session.sensors.values[channel] = value
    if session.exchanges and session.replies.at(session.exchanges) is None:
        return False, []  # the simulated device has no form for it
    poll = session.poll(new_values=False)
    violations = violations_of(poll, GOOD | NO_NUMBER) or list(poll.undetectable)
    if violations:
        return False, violations
    index = [c.name for c in session.gauge.channels].index(channel)
    reading = poll.readings[index]
    if not reading.ok:
        return False, []
    if abs(reading.value - value) <= 2 * session.replies.digit[channel]:
        return True, []
    lowest, highest = session.replies.interval(channel, session.exchanges)
    if math.isfinite(highest - lowest):
        return True, []
    end = lowest if math.isinf(highest) else highest
    if abs(reading.value - end) <= 2 * session.replies.digit[channel]:
        return False, []  # it shows its end for all values beyond, which cannot be told from the end itself
    text = f"{channel}: {reading.value:.9g} as ok, the sensor had {value:.9g}: the device shows the same for all"
    return False, [f"{text} beyond {end:.9g}, so that it is no measurement"]


def _special_values(digit: float, lowest: float, highest: float) -> Iterator[float]:
    """0, and numbers of digits at which a carry, a counter or a sign rolls over, inside the range."""
    numbers = {0.0, 1.0, 2.0}
    for power in range(MAX_POWERS):
        numbers |= {2.0**power - 1, 2.0**power, 10.0**power - 1, 10.0**power, 5 * 10.0**power}
    for number in sorted(numbers):
        for value in (number * digit, -number * digit):
            if lowest <= value <= highest:
                yield value


def _small_steps(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Each sensor moves by one digit from poll to poll, then stands still."""
    case = "small steps, then standstill"
    if not subject.exact:
        return CaseResult(case, "", IN_VIRTUAL_TIME, "-")
    session.sensors.advance()
    violations = []
    for step in (*[1.0] * SMALL_STEPS, *[-1.0] * SMALL_STEPS, *[0.0] * SMALL_STEPS):
        for name, value in session.sensors.values.items():
            session.sensors.values[name] = value + step * session.replies.digit[name]
        poll = session.poll(new_values=False)
        violations += [*violations_of(poll, GOOD), *poll.undetectable]
    return result_of(case, GOOD, f"ok, {3 * SMALL_STEPS} polls", violations)


def _many_polls(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Thousands of polls, all over the range: even and logarithmic in turn."""
    case = "thousands of polls"
    if not subject.exact:
        return CaseResult(case, "", IN_VIRTUAL_TIME, "-")
    violations: list[str] = []
    without = 0
    session.recover()
    polls = max(MIN_POLLS, MANY_EXCHANGES // max(1, len(session.exchanges)))
    for number in range(polls):
        for index, name in enumerate(session.sensors.values):
            share = (number * GOLDEN + index * 0.0719) % 1.0
            session.sensors.values[name] = share_of(session, name, share, logarithmic=number % 2 == 1)
        if number < WATCHED_POLLS:
            with clock_calls() as called:
                poll = session.poll(new_values=False)
            violations += [f"poll {number + 1}: `read` calls {name}" for name in called]
        else:
            poll = session.poll(new_values=False)
        violations += [f"poll {number + 1}: {text}" for text in violations_of(poll, GOOD | NO_VALUE)]
        violations += [f"poll {number + 1}: {text}" for text in poll.undetectable]
        without += poll.qualities != GOOD
    if without > MAX_WITHOUT_VALUE * polls:
        violations.append(f"{without} of them without a value, in a range where each number was read before")
    session.recover()
    return result_of(case, GOOD | NO_VALUE, f"ok; {without} of {polls} without a value", violations)


def share_of(session: ConformanceSession, channel: str, share: float, logarithmic: bool) -> float:
    """The value at a share (0 to 1) of the channel's whole range."""
    lowest, highest = session.sensors.whole.get(channel, session.sensors.extents[channel])
    if not logarithmic or lowest * highest >= 0:
        return lowest + share * (highest - lowest)
    end = highest if share >= 0.5 else lowest
    smallest = min(session.replies.digit[channel], abs(end))
    return math.copysign(smallest * (abs(end) / smallest) ** abs(2 * share - 1), end)


def _two_of_them(session: ConformanceSession, subject: Subject) -> CaseResult:
    """A second gauge of the same kind, with other values, polled in turn with the first."""
    case = "two of them at once"
    if subject.another is None or not subject.exact:
        return CaseResult(case, "", IN_VIRTUAL_TIME, "-")
    second = subject.another(subject.options)
    violations: list[str] = []
    second.sensors.advance()
    for _ in range(SMALL_STEPS):
        polls: Sequence[Poll] = (second.poll(), session.poll())
        violations += [text for poll in polls for text in [*violations_of(poll, GOOD), *poll.undetectable]]
    second.close()
    return result_of(case, GOOD, "ok", violations)


VALUE_CASES: tuple[Case, ...] = (
    _ends_of_range,
    _whole_range,
    _small_steps,
    _many_polls,
    _sensor_off,
    _two_of_them,
)
