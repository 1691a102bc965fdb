from .effects_file import EFFECTS_FILE as EFFECTS_FILE
from .effects_file import beside_library as beside_library
from .effects_file import gather_effects as gather_effects
from .effects_file import load_effects as load_effects
from .effects_file import named_effect as named_effect
from .library import BUNDLED as BUNDLED
from .library import find_effect as find_effect
from .library import load_library as load_library
