# The installed package, without tests:
#   docker build -t rso-lidar .
#   docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" rso-lidar new approach --from tdrs_approach
#   docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" rso-lidar run approach.toml -o approach.h5
# The checkout, for `make demo` and `make test`; `docker cp` copies out/ of the container `demo`:
#   docker build --target checkout -t rso-lidar:checkout .
#   docker run --name demo rso-lidar:checkout make demo
#   docker run --rm rso-lidar:checkout make test
FROM python:3.13-slim AS checkout
# hadolint ignore=DL3008
RUN apt-get update && apt-get install --yes --no-install-recommends make && rm -rf /var/lib/apt/lists/*
RUN useradd --create-home --uid 1000 user && mkdir /source && chown user /source
USER 1000
WORKDIR /source
COPY --chown=1000 . .
RUN make venv
CMD ["make", "demo"]

FROM python:3.13-slim AS build
WORKDIR /source
COPY . .
RUN python -m venv /opt/rso_lidar \
    && sed -n '/^pip==/,/[^\]$/p' constraints.txt > pip.txt \
    && /opt/rso_lidar/bin/pip install --no-cache-dir --require-hashes -r pip.txt \
    && PIP_NO_REQUIRE_HASHES=1 /opt/rso_lidar/bin/pip install --no-cache-dir -c constraints.txt --build-constraint constraints.txt .

FROM python:3.13-slim
COPY --from=build /opt/rso_lidar /opt/rso_lidar
RUN useradd --create-home --uid 1000 user && mkdir /data /cache && chown user /data && chmod 1777 /cache
# Any user may run it: compiled loops, fonts and settings lie in /cache.
ENV PATH=/opt/rso_lidar/bin:$PATH HOME=/cache NUMBA_CACHE_DIR=/cache/numba MPLCONFIGDIR=/cache/matplotlib
USER 1000
WORKDIR /data
ENTRYPOINT ["rso-lidar"]
CMD ["--help"]
