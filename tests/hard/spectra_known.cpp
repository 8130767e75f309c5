// Bodies whose symmetry makes modes degenerate, against frequencies that no mesh gave
// (tests/unit/precompute/fem/error_bars/data/known_frequencies.csv).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/hard/figure.hpp"
#include "tests/hard/spectra_body.hpp"
#include "tests/unit/precompute/fem/error_bars/bodies.hpp"

namespace carillon::hard {
namespace {

std::vector<double> read_known(const std::string& body, std::size_t count) {
  std::vector<double> known;
  for (const tests::Truth& truth : tests::read_truth(body)) known.push_back(truth.freq_hz);
  known.resize(count);
  return known;
}

/// A band that ends in the middle between two known modes, in the terms of a mesh that is `sharp` times too sharp.
Body make_cube(int cells, int order) {
  return {shapes::make_box({0.05, 0.05, 0.05}, {cells, cells, cells}, order), {make_solid(200e9, 0.3, 7850)}};
}

TEST(spectra, cube_triples) {
  // 2, 3, 3, 3, 3 and 3 degenerate modes. The mesh, though mirrored from cell to cell, has not all of the symmetry: it parts the fourth
  // group, Lame's.
  const std::string id = "cube_triples";
  const std::vector<double> known = read_known("cube", 17);
  const Body coarse = make_cube(4, 1), fine = make_cube(4, 2);
  eigen::Options options = make_band(20, 80e3);
  options.max_modes = 17;
  const Answer linear = hold_every_way(id, "T4", coarse, options);
  hold_bars(id, "T4", coarse, linear, options, known);
  const Answer quadratic = hold_every_way(id, "T10", fine, options);
  hold_bars(id, "T10", fine, quadratic, options, known);
  hold_groups(id, "T10", quadratic.freq_hz, 0, {2, 3, 3}, 1e-9);
  hold_groups(id, "T10 parted by the mesh", quadratic.freq_hz, 8, {3, 3, 3}, 0.01);
}

TEST(spectra, sphere_multiplets) {
  // 5, 5, 3, 7, 7 degenerate modes and more, up to 13; a mesh of tetrahedra has less symmetry and parts them, within their bars.
  const std::string id = "sphere_multiplets";
  for (const int order : {1, 2}) {
    const std::string part = order == 1 ? "T4" : "T10";
    const Body ball{
        shapes::make_shape({.shape = "sphere", .dimensions = {{"radius", 0.05}}, .order = order, .target_nodes = order == 1 ? 300 : 700}),
        {make_solid(200e9, 0.3, 7850)}};
    eigen::Options options = make_band(20, 200e3);
    options.max_modes = order == 1 ? 28 : 103;
    const std::vector<double> known = read_known("ball", static_cast<std::size_t>(*options.max_modes));
    const Answer answer = hold_every_way(id, part, ball, options);
    hold_bars(id, part, ball, answer, options, known);
    hold_groups(id, part, answer.freq_hz, 0, {5, 5, 3, 7, 7}, order == 1 ? 0.05 : 0.005);
  }
}

TEST(spectra, plate_pairs) {
  // A square plate of a tenth of its edge: a pair at the fourth mode, single modes next to them.
  const std::string id = "plate_pairs";
  for (const int order : {1, 2}) {
    const std::string part = order == 1 ? "T4" : "T10";
    const Body plate{shapes::make_box({0.1, 0.1, 0.01}, {order == 1 ? 10 : 6, order == 1 ? 10 : 6, 1}, order),
                     {make_solid(200e9, 0.3, 7850)}};
    eigen::Options options = make_band(20, 80e3);
    options.max_modes = 14;  // T10 have the pair that is really the 14th and 15th above this cut
    const Answer answer = hold_every_way(id, part, plate, options);
    hold_bars(id, part, plate, answer, options, read_known("slab", 14));
    if (order == 2) hold_groups(id, part, answer.freq_hz, 3, {2}, 1e-9);
  }
}

TEST(spectra, bowl_pairs) {
  // Hemisphere of ceramic, middle radius 60 mm, wall 4 mm, from 5 to 90 degrees from its pole, E 72 GPa, nu 0.22, rho 2700. Fourier-Ritz,
  // 1e-7: two modes each with 2, 3, 4, 5 and 6 waves round the rim.
  const std::string id = "bowl_pairs";
  const std::vector<double> known{1120.082882, 1120.082882, 2903.521511, 2903.521511, 5210.357324,
                                  5210.357324, 7943.145798, 7943.145798, 11067.43845, 11067.43845};
  for (const int order : {1, 2}) {
    const std::string part = order == 1 ? "T4" : "T10";
    // A tube, bent: along its axis goes the angle from the pole.
    const mesh::TetMesh tube = shapes::make_shape({.shape = "tube",
                                                   .dimensions = {{"length", 0.09}, {"outer-radius", 0.036}, {"wall", 0.004}},
                                                   .order = order,
                                                   .target_nodes = order == 1 ? 400 : 1000});
    const auto bend = [](const Vec3& x) {
      const double polar = std::numbers::pi / 180 * (5 + 85 * (x[0] / 0.09 + 0.5));
      const double rho = std::hypot(x[1], x[2]), r = 0.06 + (rho - 0.034);
      return Vec3{-r * std::cos(polar), r * std::sin(polar) * x[1] / rho, r * std::sin(polar) * x[2] / rho};
    };
    Body bowl{move_nodes(tube, bend), {make_solid(72e9, 0.22, 2700)}};
    mesh::check_mesh(bowl.mesh);
    eigen::Options options = make_band(20, 200e3);
    options.max_modes = order == 1 ? 4 : 10;
    const Answer answer = hold_every_way(id, part, bowl, options);
    hold_bars(id, part, bowl, answer, options, known);
    if (order == 2) hold_groups(id, part, answer.freq_hz, 0, {2, 2}, 1e-9);
  }
}

TEST(spectra, ring_pairs) {
  const std::string id = "ring_pairs";
  for (const int order : {1, 2}) {
    const std::string part = order == 1 ? "T4" : "T10";
    const Body ring{shapes::make_shape({.shape = "tube",
                                        .dimensions = {{"length", 0.012}, {"outer-radius", 0.04}, {"wall", 0.01}},
                                        .order = order,
                                        .target_nodes = order == 1 ? 300 : 700}),
                    {make_solid(100e9, 0.34, 8500)}};
    eigen::Options options = make_band(20, 80e3);
    options.max_modes = 12;
    const Answer answer = hold_every_way(id, part, ring, options);
    hold_bars(id, part, ring, answer, options, read_known("ring", 12));
    hold_groups(id, part, answer.freq_hz, 0, {2, 2, 2, 2}, order == 1 ? 1e-2 : 1e-3);
  }
}

}  // namespace
}  // namespace carillon::hard
