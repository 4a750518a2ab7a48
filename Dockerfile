# The program alone: nothing else is in the image, and it runs as no root.
#
#   docker build -t stillpoint .
#   docker run --rm --read-only --user "$(id -u):$(id -g)" \
#     -v "$PWD/scans:/scans:ro" -v "$PWD/library:/robots:ro" -v "$PWD/result:/result" \
#     stillpoint run /scans/hall.e57 --robots /robots --out /result
#
# Scans and robots are mounted read-only; the only folder that is written to is that of the result, which must
# belong to the user who runs it. Memory of the container should be a gigabyte above `--memory`.
FROM rust:1.95-slim-bookworm AS build
# The base image names its release of Debian, which has one version of each package.
# hadolint ignore=DL3008
RUN apt-get update -q && apt-get install -y -q --no-install-recommends g++ binutils && rm -rf /var/lib/apt/lists/*
WORKDIR /source
COPY . .
RUN OUT=/dist scripts/static

FROM scratch
COPY --from=build /dist/stillpoint /dist/LICENSE /
USER 65532:65532
ENTRYPOINT ["/stillpoint"]
CMD ["--help"]
