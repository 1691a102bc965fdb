"""The keys of the messages that the daemon sends, with meaning and unit: one model per message.

The models are the reference of the protocol, and make the messages: `message` and `line` take no other keys. SETPOINT
and READINGS are written once per cycle, and are made by `Setpoint.to_json` and `ReadingsMessage.line` directly. Tests
hold the values of every message to its model. A key with a default is absent where it is not known. What a client
sends is described in `client_requests` and `local_requests`.
"""
