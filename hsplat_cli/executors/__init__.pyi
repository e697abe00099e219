from .executor import open_executor as open_executor
from .options import (
    require_scheduler as require_scheduler,
    require_untimed as require_untimed,
    scheduler_option as scheduler_option,
)
