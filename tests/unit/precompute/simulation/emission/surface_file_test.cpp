// Recorded surfaces: playback, resumed runs, truncated and modified files.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "runtime/acoustics/recording/player.hpp"
#include "runtime/acoustics/recording/recording.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sha256.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/precompute/simulation/emission/motions.hpp"

namespace carillon::emission {
namespace {

using namespace testing;

constexpr std::uint64_t kFrames = 1500;

/// Two balls: one flies, rotates and rings, the other one rings.
SurfacePart make_pair() {
  SurfacePart part = make_part(air::testing::make_ball(3, 0.03));
  const SurfacePart other = make_part(air::testing::make_ball(2, 0.05));
  const auto nodes = static_cast<std::int32_t>(part.nodes_m.size());
  for (const Vec3& x : other.nodes_m) {
    part.node_number.push_back(static_cast<std::int64_t>(part.nodes_m.size()));
    part.nodes_m.push_back(x + Vec3{0.0, 0.4, 0.0});
  }
  for (const Triangle& t : other.triangles) {
    part.triangle_number.push_back(static_cast<std::int64_t>(part.triangles.size()));
    part.triangles.push_back({t[0] + nodes, t[1] + nodes, t[2] + nodes});
    part.body.push_back(1);
  }
  return part;
}

Vec3 move(const Vec3& x, double t) {
  if (x[1] > 0.2) return 2e-6 * std::sin(kTwoPi * 3500.0 * t) * normalise(x - Vec3{0.0, 0.4, 0.0});
  const double spin = 30.0 * t, c = std::cos(spin), s = std::sin(spin);
  const Vec3 radial = normalise(x), grown = x + 1e-6 * std::sin(kTwoPi * 1800.0 * t) * (1.0 + 0.5 * radial[0]) * radial;
  return Vec3{c * grown[0] - s * grown[1], s * grown[0] + c * grown[1], grown[2]} + Vec3{0.0, 0.0, 4.0 * t} - x;
}

Options make_file_options(const std::filesystem::path& file) {
  Options options = make_options(kFrames, {0.5, 0.1, 0.2}, 16);
  Microphone other;
  other.place_m = {-0.3, 0.6, 0.1};
  other.directivity = 0.5;
  options.receivers.push_back(other);
  options.surface_file = file;
  return options;
}

std::vector<std::vector<double>> run(Emission& sound, const SurfacePart& part, int begin = 0) {
  for (int n = begin; n <= static_cast<int>(kFrames) * 16; ++n) sound.add_step(calc_displacement(part, move, n / 768e3).data());
  sound.finish();
  return {sound.calc_sound(0), sound.calc_sound(1)};
}

class SurfaceFiles : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = new tests::Folder;
    file = *folder / "pair.surface.hdf";
    const SurfacePart part = make_pair();
    Emission sound(MPI_COMM_SELF, part, make_file_options(file));
    heard = run(sound, part);
  }
  static void TearDownTestSuite() { delete folder; }
  static inline tests::Folder* folder = nullptr;
  static inline std::filesystem::path file;
  static inline std::vector<std::vector<double>> heard;
};

TEST_F(SurfaceFiles, PlaybackMatchesSound) {
  const recording::RecordedSurface recording(file);
  EXPECT_EQ(recording.get_header().frames, kFrames);
  EXPECT_EQ(recording.get_header().bodies, 2U);
  EXPECT_FALSE(std::filesystem::exists(file.string() + ".part"));
  const auto receivers = make_file_options({}).receivers;
  recording::Player player(recording, 2);
  std::vector<double> played[2];
  for (std::size_t count : {1U, 100U, 37U, 862U, 500U}) {
    std::vector<double> out(2 * count, 0.0);
    player.play(receivers, count, out);
    for (std::size_t i = 0; i < 2; ++i)
      played[i].insert(played[i].end(), out.begin() + static_cast<std::ptrdiff_t>(i * count),
                       out.begin() + static_cast<std::ptrdiff_t>((i + 1) * count));
  }
  for (std::size_t i = 0; i < 2; ++i) {
    double error = 0.0, power = 0.0;
    for (std::size_t n = 0; n < kFrames; ++n) {
      error += std::pow(played[i][n] - heard[i][n], 2);
      power += std::pow(heard[i][n], 2);
    }
    RecordProperty("error_db_" + std::to_string(i), std::to_string(10.0 * std::log10(error / power)));
    EXPECT_LT(error, 1e-5 * power) << i;
  }
  std::vector<double> silence(2 * 4000, 0.0);
  player.play(receivers, 4000, silence);
  EXPECT_EQ(silence[3999], 0.0);  // all has arrived
}

TEST_F(SurfaceFiles, RecordedPositions) {
  const recording::RecordedSurface recording(file);
  const SurfacePart part = make_pair();
  std::vector<Vec3> places(part.nodes_m.size());
  for (const std::uint64_t key : {0U, 1U, 17U, 31U}) {
    recording.read_places(key, places);
    for (std::size_t v = 0; v < places.size(); ++v)
      EXPECT_LT(norm(places[v] - part.nodes_m[v] - move(part.nodes_m[v], static_cast<double>(key) * 48.0 / 48000.0)), 4e-6)
          << key << " " << v;
  }
}

TEST_F(SurfaceFiles, ResumedRun) {
  const SurfacePart part = make_pair();
  Options options = make_file_options(*folder / "again.surface.hdf");
  std::vector<std::byte> state;
  {
    Emission first(MPI_COMM_SELF, part, options);
    for (int n = 0; n < 9000; ++n) first.add_step(calc_displacement(part, move, n / 768e3).data());
    state = first.save();
    for (int n = 9000; n < 18000; ++n) first.add_step(calc_displacement(part, move, n / 768e3).data());  // discarded
  }
  EXPECT_FALSE(std::filesystem::exists(options.surface_file));
  options.is_resumed = true;
  Emission second(MPI_COMM_SELF, part, options);
  second.load(state);
  EXPECT_EQ(run(second, part, 9000), heard);
  EXPECT_EQ(tests::read_all(options.surface_file) == tests::read_all(file), true);

  EXPECT_NE(tests::catch_message<InputError>([&] { Emission(MPI_COMM_SELF, part, options); }).find("the run resumes and needs it"),
            std::string::npos);
}

TEST_F(SurfaceFiles, FileOfAnotherRun) {
  const SurfacePart part = make_pair();
  Options options = make_file_options(*folder / "other.surface.hdf");
  { Emission first(MPI_COMM_SELF, part, options); }
  options.is_resumed = true;
  options.frames = 1400;
  EXPECT_NE(tests::catch_message<InputError>([&] { Emission(MPI_COMM_SELF, part, options); }).find("is of another run"), std::string::npos);
}

TEST_F(SurfaceFiles, TruncatedFiles) {
  const std::string bytes = tests::read_all(file);
  std::vector<std::size_t> cuts;
  for (std::size_t n = 0; n < 4300; ++n) cuts.push_back(n);
  for (std::size_t n = 4300; n < bytes.size(); n += 4999) cuts.push_back(n);
  cuts.push_back(bytes.size() - 1);
  for (const std::size_t cut : cuts) {
    const std::string part = bytes.substr(0, cut);
    const auto message = tests::catch_message<InputError>([&] { recording::RecordedSurface(part, "cut.surface.hdf"); });
    ASSERT_EQ(message.find("cut.surface.hdf: "), 0U) << cut << ": " << message;
  }
  const auto path = folder->write("cut.surface.hdf", bytes.substr(0, 100000));
  EXPECT_NE(tests::catch_message<InputError>([&] { recording::RecordedSurface{path}; }).find("truncated: 100000 bytes"), std::string::npos);
}

TEST_F(SurfaceFiles, ChangedBytes) {
  std::string bytes = tests::read_all(file);
  for (std::size_t at = 0; at < bytes.size(); at += 97777) {
    bytes[at] = static_cast<char>(bytes[at] ^ 0x40);
    EXPECT_THROW(recording::RecordedSurface(bytes, "changed"), InputError) << at;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x40);
  }
  EXPECT_NO_THROW(recording::RecordedSurface(bytes, "whole"));
}

TEST_F(SurfaceFiles, InvalidTablesWithValidDigest) {
  const std::string bytes = tests::read_all(file);
  const recording::RecordedSurface recording(bytes, "whole");
  const auto refuse = [&](recording::Array array, std::size_t at, auto value) {
    std::string bad = bytes;
    bad.replace(recording.get_header().offset[static_cast<std::size_t>(array)] + at, sizeof(value), reinterpret_cast<const char*>(&value),
                sizeof(value));
    base::Sha256 sha;
    sha.add(std::string_view(bad).substr(0, recording::kTextBytes));
    sha.add(std::string_view(bad).substr(recording::kHeaderBytes));
    bad.replace(recording::kTextBytes, recording::kDigestBytes, base::to_hex(sha.finish()));
    return tests::catch_message<InputError>([&] { recording::RecordedSurface(bad, "bad"); });
  };
  EXPECT_NE(refuse(recording::Array::kTriangle, 12, std::int32_t{1 << 20}).find("triangle[1] names a missing vertex"), std::string::npos);
  EXPECT_NE(refuse(recording::Array::kTriangleBody, 4, std::int32_t{2}).find("triangle_body[1]"), std::string::npos);
  EXPECT_NE(refuse(recording::Array::kVertexBody, 4, std::int32_t{-1}).find("vertex_body[1]"), std::string::npos);
  EXPECT_NE(refuse(recording::Array::kArea, 8, -1.0).find("area[1]"), std::string::npos);
  EXPECT_NE(refuse(recording::Array::kRadius, 8, 0.0).find("radius[1]"), std::string::npos);
  EXPECT_NE(refuse(recording::Array::kCentre, 8, std::nan("")).find("centre[1]"), std::string::npos);
  EXPECT_NE(refuse(recording::Array::kStep, 8, -1.0).find("step[1]"), std::string::npos);
  EXPECT_NE(refuse(recording::Array::kScale, 4, -1.0F).find("scale[1]"), std::string::npos);
}

}  // namespace
}  // namespace carillon::emission
