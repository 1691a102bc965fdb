"""Described gauges: one YAML file each. Offered to compd by the entry point `compd.gauge_presets`."""

from importlib.resources import files

from compd_drivers.preset_directory import PresetDirectory

directory = PresetDirectory(files(__name__))
