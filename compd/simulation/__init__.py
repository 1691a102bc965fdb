"""The simulated machine: the truth that the model is tested against, and it shares no code with the model.

Causes displace things, and the closure says where the tip goes; nothing computes a tip error:

    weather -> warm_up (heat) -> frame: supports, plate points, rods    -.
                              -> joints: balls   <- closure: forces      +-> closure -> tip
    motion, tour              -> scales: link lengths, rods             -'
                                        sensors <- what each gauge can see of all that

`strengths` says how strong every cause is. `world` holds it together; `server` puts it on real ports (`wire`,
`sensing`), with a control socket (`control`) and a configuration for the daemon (`daemon_configuration`).
"""
