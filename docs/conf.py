"""Settings of the site: ``make site`` builds it into out/site with Sphinx, and a warning is an error."""

import sys
import tomllib
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS))  # the extensions, and the generator of tables

metadata = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
project = "rso_lidar"
author = metadata["authors"][0]["name"]
copyright = author  # the word that Sphinx uses for the footer
version = release = metadata["version"]
SOURCE = metadata["urls"]["Source"]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "extensions.api_pages",
    "extensions.command_pages",
    "extensions.field_tables",
    "extensions.repository_files",
    "extensions.section_search",
    "extensions.dark_pictures",
    "extensions.offline_links",
]
exclude_patterns = ["README.md", "gallery", "tutorial", "extensions"]
nitpicky = False  # docstrings state types in words; links are checked in the built pages by extensions.offline_links
default_role = "code"
highlight_language = "text"
pygments_style = "a11y-high-contrast-light"
suppress_warnings = ["config.cache"]  # the settings of sphinx-gallery hold functions

# Pages in Markdown: headings have the anchors that GitHub gives them.
myst_heading_anchors = 5
myst_enable_extensions = ["colon_fence", "attrs_inline"]

# The API from docstrings. Fields of parts and records come from extensions.field_tables.
autodoc_preserve_defaults = True  # `scheme=LIGHT`, and not all of its colours
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_class_signature = "separated"
autosummary_generate = False
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_param = False  # types are words, and no cross-references are made of them
napoleon_custom_sections = [("Fields", "params_style")]
viewcode_line_numbers = True

# Scripts that are run while the site is built.
sphinx_gallery_conf = {
    "examples_dirs": ["tutorial", "gallery"],
    "gallery_dirs": ["auto_tutorial", "auto_gallery"],
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"(^|/)_",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "write_computation_times": False,  # its table would load a script from another host
    "min_reported_time": 10,
    "default_thumb_file": str(DOCS / "pictures" / "tdrs_approach.png"),
    "plot_gallery": "True",
    "subsection_order": [
        *(
            f"gallery/{name}"
            for name in ("missions", "instrument", "studies", "how_do_i", "own_parts", "learning", "connect")
        ),
        "*",
    ],
    "image_scrapers": ("matplotlib", "extensions.figure_scraper.scrape_last_value"),
    "reset_modules": (
        "matplotlib",
        "extensions.figure_scraper.use_style",
        "extensions.figure_scraper.use_temporary_folder",
    ),
    "capture_repr": ("_repr_html_",),  # the values of other cells are printed
    "first_notebook_cell": "%matplotlib inline\n# %pip install rso-lidar",
    "copyfile_regex": r".*\.(toml|csv)$",
}

html_theme = "pydata_sphinx_theme"
html_title = f"rso_lidar {version}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "logo": {"text": "rso_lidar"},
    "icon_links": [{"name": "Repository", "url": SOURCE, "icon": "fa-brands fa-github"}],
    "navigation_with_keys": True,
    "show_prev_next": True,
    "show_toc_level": 2,
    "header_links_before_dropdown": 6,
    "secondary_sidebar_items": ["page-toc", "sg_download_links"],
    "footer_start": ["copyright"],
    "footer_end": ["sphinx-version"],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
