from .guard import Token as Token
from .guard import hashed as hashed
from .guard import new_token as new_token
from .run import origin as origin
from .run import run_page as run_page
from .server import print_qr_code as print_qr_code
from .token_file import add_token as add_token
from .token_file import read_tokens as read_tokens
