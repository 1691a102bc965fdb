"""The keys of the messages that the daemon sends, with meaning and unit: one model per message.

The models are the reference of the protocol; nothing that is sent passes through them. SETPOINT and READINGS are
written once per cycle, and are made by `Setpoint.to_json` and `ReadingsMessage.line` directly; tests hold every message
to its model, so that no key is sent that is not described here. A key with a default is absent where it is not known.
What a client sends, and answers that belong to one request alone, are described in `client_requests` and
`local_requests`.
"""
