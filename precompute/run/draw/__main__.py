"""carillon-draw: pictures of mode banks, of rendered scenes and of simulations, drawn off-screen with VTK.

    carillon-draw modes BANK -o OUT.png [--modes 1,2,3] [--up x|y|z]
    carillon-draw directivity BANK -o OUT.png [--modes 1,2,3] [--up x|y|z]
    carillon-draw scene TRAJECTORY.json -o OUT.png
    carillon-draw motion MOTION.vtkhdf -o OUT.png [--moments 6] [--exaggerate 1] [--colour speed|displacement] [--up x|y|z] [--frames DIR]

Exit codes: 0 done, 2 invalid input, 4 system failure.
"""
import sys

from program import main

VERSION = "unknown"  # set by the build

sys.exit(main(VERSION))
