# The installed package, without tests:
#   docker build -t rso-lidar .
#   docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" rso-lidar new approach --from tdrs_approach
#   docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" rso-lidar run approach.toml -o approach.h5
FROM python:3.13-slim AS build
WORKDIR /source
COPY . .
RUN python -m venv /opt/rso_lidar \
    && /opt/rso_lidar/bin/pip install --no-cache-dir -c constraints.txt --build-constraint constraints.txt .

FROM python:3.13-slim
COPY --from=build /opt/rso_lidar /opt/rso_lidar
RUN useradd --create-home --uid 1000 user && mkdir /data /cache && chown user /data && chmod 1777 /cache
# Any user may run it: compiled loops, fonts and settings lie in /cache.
ENV PATH=/opt/rso_lidar/bin:$PATH HOME=/cache NUMBA_CACHE_DIR=/cache/numba MPLCONFIGDIR=/cache/matplotlib
USER user
WORKDIR /data
ENTRYPOINT ["rso-lidar"]
CMD ["--help"]
