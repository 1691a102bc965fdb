"""The far ends of lines, simulated: devices, what faults do to their replies, and the ports of this computer.

They are written from the standards, and share no code with the near ends.
"""
