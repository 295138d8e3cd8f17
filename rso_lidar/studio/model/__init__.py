"""What the studio shows, without the browser: forms, edits of TOML texts, previews of frames and views, file summaries."""
