from .built_geometry import BuiltGeometry as BuiltGeometry
from .built_geometry import built_geometry as built_geometry
from .machine_file import BuiltFiles as BuiltFiles
from .machine_file import Provenance as Provenance
from .machine_file import write_built_machine as write_built_machine
