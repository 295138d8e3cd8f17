"""The command line: `rso-lidar`, or `python -m rso_lidar`."""

from rso_lidar.cli import main

if __name__ == "__main__":
    main()
