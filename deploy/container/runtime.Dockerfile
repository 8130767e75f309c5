# The runtime side: carillon-render, carillon-live, carillon-bank and the library to build against. No MPI, no PETSc.
#   docker build -t carillon-runtime -f deploy/container/runtime.Dockerfile .
# Installs by deploy/install and its package lists. docs/howto/install.md
FROM debian:bookworm AS build
COPY deploy/install deploy/install
COPY deploy/packages deploy/packages
RUN deploy/install build runtime
COPY . /carillon
WORKDIR /carillon
RUN . deploy/environment && cmake --preset runtime-only -DCARILLON_TESTS=OFF && cmake --build --preset runtime-only -j "$jobs" -- --quiet
RUN cmake --install build/runtime-only --prefix /usr/local --strip

FROM debian:bookworm
COPY deploy/install deploy/install
COPY deploy/packages deploy/packages
RUN deploy/install runtime
COPY --from=build /usr/local /usr/local
RUN ldconfig
WORKDIR /data
CMD ["carillon-render", "--help"]
