// A recorded surface of version 1.0: an octahedron of 5 cm that flies past and rings at 2 kHz, 600 samples at 48 kHz.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/acoustics/recording/player.hpp"
#include "runtime/acoustics/recording/recording.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/folder.hpp"
#include "tests/support/paths.hpp"
#include "tests/unit/runtime/acoustics/recording/seal_again.hpp"

namespace carillon::recording {
namespace {

std::string read_pinned() {
  return tests::read_all(carillon::tests::get_source_dir() + "/tests/unit/runtime/acoustics/recording/corpus/octahedron.surface.hdf");
}

TEST(Pinned, FilesOfVersionOneStayReadable) {
  const std::string bytes = read_pinned();
  const RecordedSurface recording(bytes, "octahedron");
  EXPECT_EQ(recording.get_header().frames, 600U);
  EXPECT_EQ(recording.get_triangles().size(), 8U);
  EXPECT_NEAR(recording.get_areas_m2()[0], 0.05 * 0.05 * std::sqrt(3.0) / 2.0, 1e-12);
  EXPECT_NEAR(recording.get_radii_m()[0], std::sqrt(8.0 * recording.get_areas_m2()[0] / (4.0 * std::numbers::pi)), 1e-12);
  std::vector<Vec3> places(6);
  recording.read_places(10, places);
  EXPECT_NEAR(places[0][0], 0.05 + 3.0 * 0.01, 5e-6);
}

TEST(Pinned, AnUnmovedSourceIsHeardByTheClosedForm) {
  // Volume acceleration: 1e-5 m of radial motion at the corners, mean over facets: area / sqrt(3).
  const std::string bytes = read_pinned();
  const RecordedSurface recording(bytes, "octahedron");
  Player player(recording, 1);
  std::vector<Microphone> receivers(1);
  receivers[0].place_m = {0.0, 0.0, 2.0};
  std::vector<double> sound(900, 0.0);
  player.play(receivers, sound.size(), sound);
  const double omega = 2.0 * std::numbers::pi * 2000.0, ka = omega / 343.0 * recording.get_radii_m()[0];
  const double volume = 8.0 * recording.get_areas_m2()[0] / std::sqrt(3.0) * 1e-5 * omega * omega;
  const double wanted = 1.21 * volume / (4.0 * std::numbers::pi * 2.0);
  const double most = *std::max_element(sound.begin() + 400, sound.begin() + 800);
  // A sphere of this surface lies between 1 / sqrt(1 + (ka)^2), and an octahedron near it.
  EXPECT_NEAR(most, wanted / std::sqrt(1.0 + ka * ka), 0.2 * wanted);
  EXPECT_EQ(*std::max_element(sound.begin(), sound.begin() + 230),
            *std::min_element(sound.begin(), sound.begin() + 230));  // 2 m are 280 samples
}

TEST(Pinned, EveryChangedByteBehindAGoodSealPlaysOrIsRefused) {
  const std::string bytes = read_pinned();
  int played = 0, refused = 0;
  for (std::size_t at = 0; at < bytes.size(); at += at < 600 ? 1 : 37) {
    for (const char flip : {'\x01', '\x40', '\x80'}) {
      std::string changed = bytes;
      changed[at] = static_cast<char>(changed[at] ^ flip);
      changed = testing::seal_again(changed);
      try {
        const RecordedSurface recording(changed, "changed");
        Player player(recording, 1);
        std::vector<Microphone> receivers(1);
        receivers[0].place_m = {0.3, 0.0, 0.0};
        std::vector<double> out(64, 0.0);
        player.play(receivers, out.size(), out);
        ++played;
      } catch (const InputError& error) {
        EXPECT_EQ(std::string(error.what()).find("changed: "), 0U) << at;
        ++refused;
      }
    }
  }
  EXPECT_GT(played, 100);
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace carillon::recording
