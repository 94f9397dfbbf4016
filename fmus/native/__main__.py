"""Print the equations of a component in C: `python -m fmus.native AuvPlant`."""

import argparse

from fmus.discovery import components, source_of
from fmus.native.translator import translated

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m fmus.native", description=__doc__)
    parser.add_argument("component", choices=components())
    print(translated(source_of(parser.parse_args().component).definition), end="")
