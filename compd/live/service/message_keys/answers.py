"""The keys of the answers to orders, and of AUTH."""

from __future__ import annotations

from compd.live.service.message_keys.message import ModelsKeys, SentMessage, absent, present


class ReleaseKeys(SentMessage):
    """Answers RELEASE: the mode is CMM again."""

    wire_name = "RELEASE"


class AuthKeys(SentMessage):
    """Greets a TCP client in place of VERSION where a token is configured: send AUTH with it."""

    wire_name = "AUTH"


class AcceptKeys(SentMessage):
    """Answers ACCEPT."""

    wire_name = "ACCEPT"
    gauges: list[str] = present("channels that are believed again by it; empty where all were already")
    believed_for_s: dict[str, float] | None = absent(
        "of each of them, for how long it has been believed when this is sent, s"
    )
    not_believed: dict[str, str] | None = absent("channels that are not believed after it either, each with the reason")


class PollKeys(SentMessage):
    """Answers POLL: the gauge will be polled within a second, if its line is open. STATUS counts its polls."""

    wire_name = "POLL"


class ZeroKeys(SentMessage):
    """Answers ZERO when machine zero has been taken."""

    wire_name = "ZERO"
    taken_at: str = present("when, UTC, ISO 8601")
    path: str = present("the file in which it is kept")
    readings_mm: dict[str, float] = present("mean raw reading of every length gauge, by channel, mm")
    changed_mm: dict[str, float] | None = absent(
        "by how much each gauge differs from the machine zero before, mm; absent where there was none"
    )
    quantities: dict[str, float] | None = absent("mean of every other quantity, by name: from these effects count")
    without: list[str] | None = absent("quantities that could not be read; models with effects of these are refused")


class ModelKeys(SentMessage, ModelsKeys):
    """Answers MODEL."""

    wire_name = "MODEL"
    kept: bool = present("whether the daemon starts with the applied model again, by its configuration as it was read")
    kept_text: str = present("the same for people, with what keeps it where it is not kept")
