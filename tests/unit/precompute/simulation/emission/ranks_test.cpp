// Bit-identical results on any number of ranks: triangles distributed over ranks, and the whole on each rank alone.
#include "tests/support/ranks.hpp"

#include <gtest/gtest.h>
#include <mpi.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "precompute/simulation/emission/emission.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/precompute/simulation/emission/motions.hpp"

namespace carillon::emission {
namespace {

using namespace testing;

SurfacePart deal(const SurfacePart& whole) {
  SurfacePart part;
  std::map<std::int32_t, std::int32_t> place;
  for (std::size_t t = 0; t < whole.triangles.size(); ++t) {
    // Rank 1 of several has none.
    const int owner = tests::get_ranks() < 3             ? static_cast<int>(t * 7 / 3) % tests::get_ranks()
                      : static_cast<int>(t % 5 % 3) == 1 ? 2
                                                         : static_cast<int>(t % 5 % 3);
    if (owner != tests::get_rank()) continue;
    Triangle corner;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::int32_t node = whole.triangles[t][c];
      const auto [found, is_new] = place.try_emplace(node, static_cast<std::int32_t>(part.nodes_m.size()));
      if (is_new) {
        part.nodes_m.push_back(whole.nodes_m[node]);
        part.node_number.push_back(whole.node_number[node]);
      }
      corner[c] = found->second;
    }
    part.triangles.push_back(corner);
    part.triangle_number.push_back(whole.triangle_number[t]);
    part.body.push_back(whole.body[t]);
  }
  return part;
}

std::vector<double> play(const comm::Communicator& comm, const SurfacePart& part, const Options& options) {
  Emission sound(comm, part, options);
  const int steps = static_cast<int>(options.frames) * 16;
  for (int n = 0; n <= steps; ++n)
    sound.add_step(calc_displacement(
                       part,
                       [](const Vec3& x, double t) {
                         return Vec3{4.0 * t, 0.0, -2.0 * t} + 1e-6 * std::sin(kTwoPi * 4000.0 * t + 90.0 * x[1]) * normalise(x);
                       },
                       n / 768e3)
                       .data());
  sound.finish();
  return sound.calc_sound(0);
}

TEST(Ranks, BitIdenticalSound) {
  const SurfacePart whole = make_part(air::testing::make_ball(4, 0.04)), part = deal(whole);
  for (const Radiation radiation : {Radiation::kKirchhoff, Radiation::kRayleigh, Radiation::kPaper2001}) {
    Options options = make_options(260, {0.3, 0.1, 0.2}, 16);
    options.radiation = radiation;
    options.has_visibility = true;
    options.high_pass_hz = 20.0;
    EXPECT_EQ(play(MPI_COMM_WORLD, part, options), play(MPI_COMM_SELF, whole, options)) << static_cast<int>(radiation);
  }
}

TEST(Ranks, BitIdenticalRecordedSurfaces) {
  const SurfacePart whole = make_part(air::testing::make_ball(3, 0.04)), part = deal(whole);
  const tests::Folder own;
  const comm::Communicator comm(MPI_COMM_WORLD);
  const std::string shared = comm.broadcast((own / "shared.surface.hdf").string());
  Options options = make_options(600, {0.3, 0.1, 0.2}, 16);
  options.surface_file = shared;
  play(comm, part, options);
  if (comm.is_root()) {
    options.surface_file = own / "alone.surface.hdf";
    play(MPI_COMM_SELF, whole, options);
    EXPECT_EQ(tests::read_all(options.surface_file) == tests::read_all(shared), true);
  }
  comm.agree([] {});
}

TEST(Ranks, CollectiveErrors) {
  SurfacePart part = deal(make_part(air::testing::make_ball(2, 0.04)));
  Options options = make_options(60, {0.3, 0.1, 0.2}, 16);
  if (tests::get_rank() == 0) part.triangles[0][0] = 100000;
  EXPECT_THROW(Emission(MPI_COMM_WORLD, part, options), InputError);
}

}  // namespace
}  // namespace carillon::emission
