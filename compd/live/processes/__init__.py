"""The daemon's processes: the supervisor that forks and watches them, what each does, and what they tell each other."""
