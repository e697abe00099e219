from .page import NUM_PARTS as NUM_PARTS, preview_page as preview_page
