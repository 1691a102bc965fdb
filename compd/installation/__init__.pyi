from .installing import install_problems as install_problems
from .installing import install_steps as install_steps
from .replacement import Replacement as Replacement
from .replacement import go_back as go_back
from .replacement import upgrade as upgrade
from .shipped_units import own_program as own_program
from .shipped_units import shipped_file as shipped_file
from .system_command import SystemCommand as SystemCommand
