from .batch import run_batch as run_batch
from .report import BRIEFLY_S as BRIEFLY_S, INTERRUPTED as INTERRUPTED, write_report as write_report
from .single import Order as Order, make_film as make_film, tell_result as tell_result
