from .golden.draw import load_steady_job as load_steady_job
from .golden.provenance import parse_date as parse_date
from .golden.update import Wish as Wish, keep_goldens as keep_goldens
from .matching import compare_frames as compare_frames
from .report import table_of as table_of
from .run import ReportFiles as ReportFiles
from .scene import SceneOptions as SceneOptions
