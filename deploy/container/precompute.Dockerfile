# The precompute side: carillon, carillon-precompute, carillon-mesh, carillon-bank, carillon-draw, with Debian's Open MPI, PETSc and SLEPc.
#   docker build -t carillon-precompute -f deploy/container/precompute.Dockerfile .
# Installs by deploy/install and its package lists. VTK is not in them: carillon-draw, and pictures
# in reports, also need the list demo. docs/howto/install.md
FROM debian:bookworm AS build
COPY deploy/install deploy/install
COPY deploy/packages deploy/packages
RUN deploy/install build runtime precompute
COPY . /carillon
WORKDIR /carillon
RUN . deploy/environment && cmake --preset release -DCARILLON_TESTS=OFF && cmake --build --preset release -j "$jobs" -- --quiet
RUN cmake --install build/release --prefix /usr/local --strip

FROM debian:bookworm
COPY deploy/install deploy/install
COPY deploy/packages deploy/packages
RUN deploy/install runtime precompute
COPY --from=build /usr/local /usr/local
RUN ldconfig
# As deploy/environment has it: one thread a rank; in a container everybody is root.
ENV OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_hwloc_base_binding_policy=none HWLOC_COMPONENTS=-gl
ENV OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
WORKDIR /data
CMD ["carillon-precompute", "--help"]
