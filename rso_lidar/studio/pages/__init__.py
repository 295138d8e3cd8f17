"""Pages of the studio: what NiceGUI shows of documents, previews and jobs."""
