// usage: test_meshes FILE...
// Reads each mesh as the solver does and checks it. One line to standard error for each that is refused; exit code 2 if any was, 1 if a
// mesh that passed is none: a volume, a node or a reference that cannot be.
#include <cmath>
#include <cstdio>
#include <exception>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/read.hpp"
#include "runtime/config/error.hpp"

int main(int argc, char** argv) {
  using namespace carillon;
  int code = 0;
  for (int n = 1; n < argc; ++n) {
    try {
      mesh::TetMesh mesh = mesh::read_mesh(argv[n]);
      const mesh::CheckReport report = mesh::check_mesh(mesh, argv[n]);
      bool sane = report.volume_m3 > 0 && std::isfinite(report.volume_m3) && mesh.tet_count() > 0;
      for (const auto& p : mesh.nodes)
        for (const double x : p) sane = sane && std::isfinite(x);
      for (const auto v : mesh.tets) sane = sane && v >= 0 && static_cast<std::size_t>(v) < mesh.nodes.size();
      if (sane) continue;
      std::fprintf(stderr, "%s: insane\n", argv[n]);
      return 1;
    } catch (const InputError& error) {
      std::fprintf(stderr, "%s\n", error.what());
      code = 2;
    } catch (const SystemError& error) {
      std::fprintf(stderr, "%s\n", error.what());
      code = 2;
    }
  }
  return code;
}
