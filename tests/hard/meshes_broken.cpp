// Meshes that are not what they should be: mended with the same answer as the sound mesh, or refused in one line.
#include <cmath>

#include "precompute/shapes/shapes.hpp"
#include "tests/hard/figure.hpp"
#include "tests/path/run_program.hpp"

namespace carillon::hard {
namespace {

using tests::Folder;
using tests::Outcome;

/// The greatest relative distance between the frequencies of two banks; infinite where their numbers of modes differ.
double calc_distance(const bank::Bank& a, const bank::Bank& b) {
  if (a.mode_count() != b.mode_count() || a.mode_count() == 0) return HUGE_VAL;
  double worst = 0;
  for (std::size_t m = 0; m < a.mode_count(); ++m) worst = std::max(worst, std::abs(a.freq_hz(m) / b.freq_hz(m) - 1));
  return worst;
}

mesh::TetMesh make_bar(int order) { return shapes::make_box({0.1, 0.02, 0.01}, {8, 2, 1}, order); }

TEST(meshes, lone_node) {
  for (const int order : {1, 2}) {
    const std::string keys = fmt::format(R"("element": "T{}",)", order == 1 ? 4 : 10), part = keys.substr(12, order == 1 ? 2 : 3);
    mesh::TetMesh mesh = make_bar(order);
    Folder sound, spoilt;
    mesh::write_gmsh(mesh, sound / "mesh.msh");
    mesh.nodes.push_back({5, 5, 5});
    mesh::write_gmsh(mesh, spoilt / "mesh.msh");
    sound.write_job({}, keys);
    spoilt.write_job({}, keys);
    hold("lone_node", calc_distance(spoilt.solve(), sound.solve()), 1e-10, part);
    hold_refusal("lone_node", spoilt.run().output, {"mesh.msh", "1 node", "no element"}, part);
  }
}

}  // namespace
}  // namespace carillon::hard
