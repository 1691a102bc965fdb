from .drift_experiment import reproduce_drift as reproduce_drift
from .frame_experiment import run_frame_experiment as run_frame_experiment
from .frame_page import frame_table as frame_table
from .frame_page import write_frame_page as write_frame_page
from .link_experiment import reproduce_link as reproduce_link
from .plate_experiment import reproduce_plate as reproduce_plate
from .reproduction import HEAD as HEAD
from .reproduction import Reproduction as Reproduction
