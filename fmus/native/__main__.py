"""Print the equations of a component in C: `python -m fmus.native fmus.auv_plant`."""

import argparse

from fmus.native.translator import translated

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m fmus.native", description=__doc__)
    parser.add_argument("package", help="of the component, such as fmus.auv_plant")
    print(translated(parser.parse_args().package), end="")
