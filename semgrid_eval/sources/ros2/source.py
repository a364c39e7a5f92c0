"""Bags as the command line offers them; light to import."""

from semgrid_eval.sources.known import Source, later
from semgrid_eval.sources.ros2.options import Ros2Options

_HELP = """Convert ROS 2 bags to logs OUT/<split>/<bag>_<first frame>.mcap.

BAG is a folder or a single file, .mcap or .db3. The map file says which topics are which; --inspect lists the topics of
a bag and writes a first one, which usually works as it stands.

A frame has all pictures that the map names, paired by their stamps; what lacks one is left out, and counted. A sweep is
a point cloud, its points brought to the time of its stamp. Windows count frames, so a recording ends where frames or
sweeps are missing, and after --recording-s.

A bag fails as a whole, in one line, if a topic is missing or changes, its calibration is of another size, a cloud has
not the fields that the map names, its clock jumps or it is damaged. The others are converted; the exit code is then 1.
Logs whose inputs have not changed are left as they are.
"""

SOURCE = Source(
    options=Ros2Options,
    convert=later("semgrid_eval.sources.ros2.convert:convert_bags", extra="ros"),
    help=_HELP,
    example="semgrid-eval convert ros2 drive logs --map map.yaml",
    inspect=later("semgrid_eval.sources.ros2.convert:inspect", extra="ros"),
)
