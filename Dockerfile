# Sidestep on Debian 12, from its own packages:
#
#   docker build -t sidestep .
#   docker run --rm -v "$PWD/out:/out" sidestep run demo --out /out/demo
FROM debian:12 AS packages
COPY . /sidestep
RUN /sidestep/tools/package.sh

FROM debian:12
RUN --mount=from=packages,source=/sidestep/build/packages,target=/packages \
  apt-get update && apt-get install -y --no-install-recommends /packages/*.deb && rm -rf /var/lib/apt/lists/*
ENTRYPOINT ["sidestep"]
