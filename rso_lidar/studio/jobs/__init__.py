"""Jobs of the studio: commands of the command line in processes of their own, and what their recordings hold."""
