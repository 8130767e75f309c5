// SOFA files with known laws from write_sofa.py, read at several rates; unreadable files.
#include "runtime/acoustics/head/sofa.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"
#include "tests/support/folder.hpp"
#include "tests/support/paths.hpp"
#include "tests/unit/runtime/acoustics/head/oracle.hpp"

namespace carillon::head {
namespace {

using namespace testing;

std::string read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Message of the InputError, or empty.
std::string find_refusal(const std::filesystem::path& file, double rate = 48000.0) {
  try {
    read_sofa(file, rate);
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

TEST(WithoutSofa, ABuildSaysWhatToDo) {
  if (has_sofa()) GTEST_SKIP() << "built with SOFA";
  EXPECT_NE(find_refusal("mine.sofa").find("mine.sofa: this build is without SOFA; build it with CARILLON_SOFA=ON"), std::string::npos);
}

class Sofa : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!has_sofa()) GTEST_SKIP() << "built without SOFA";
  }
  std::filesystem::path write(const std::string& name, const std::string& options = "") {
    const std::filesystem::path file = folder_ / name;
    const std::string script = carillon::tests::get_source_dir() + "/tests/unit/runtime/acoustics/head/write_sofa.py ";
    const int status = std::system(("/usr/bin/python3 " + script + file.string() + " " + options).c_str());
    EXPECT_EQ(status, 0) << "python3-h5py is needed";
    return file;
  }
  const tests::Folder folder_;
};

/// Interaural level and delay by the law of write_sofa.py.
void expect_law(const std::shared_ptr<const Head>& head, const Vec3& direction, double level_tolerance, double delay_tolerance_s) {
  const Heard heard = hear_pulse(head, direction);
  const double y = direction[1] / norm(direction);
  for (const double freq : {500.0, 2000.0, 6000.0}) {
    const Complex ratio = calc_spectrum(heard.left, freq, head->get_sample_rate_hz(), 0.0) /
                          calc_spectrum(heard.right, freq, head->get_sample_rate_hz(), 0.0);
    EXPECT_NEAR(std::abs(ratio) / ((1.0 + 0.5 * y) / (1.0 - 0.5 * y)), 1.0, level_tolerance) << y << " " << freq;
    const double phase = 2.0 * std::numbers::pi * freq * 20.0 * y / 44100.0;  // the left ear is earlier
    EXPECT_NEAR(std::remainder(std::arg(ratio) - phase, 2.0 * std::numbers::pi) / (2.0 * std::numbers::pi * freq), 0.0, delay_tolerance_s)
        << y << " " << freq;
  }
}

TEST_F(Sofa, MeasuredDirectionsAreAsTheyWereMeasured) {
  const auto file = write("head.sofa");
  for (const double rate : {44100.0, 48000.0, 96000.0, 32000.0}) {
    const auto head = read_sofa(file, rate);
    EXPECT_EQ(head->get_sample_rate_hz(), rate);
    for (const auto& [azimuth, elevation] : {std::array{0.0, 0.0}, {90.0, 0.0}, {270.0, 0.0}, {40.0, 30.0}, {200.0, -60.0}, {0.0, 90.0}})
      expect_law(head, make_direction(azimuth, elevation), 2e-3, 0.3e-6);
  }
}

TEST_F(Sofa, InterpolatesBetweenDirections) {
  const auto head = read_sofa(write("head.sofa"), 48000.0);
  for (const auto& [azimuth, elevation] : {std::array{5.0, 0.0}, {93.0, 2.0}, {283.0, 47.0}, {201.0, -66.0}, {30.0, 86.0}})
    expect_law(head, make_direction(azimuth, elevation), 0.02, 4e-6);
}

TEST_F(Sofa, EquivalentFilesGiveTheSameHead) {
  for (const char* options : {"type=cartesian", "delay=4", "near=1", "rate=48000", "level=0.01", "taps=200", "step=3"}) {
    const auto head = read_sofa(write("head.sofa", options), 48000.0);
    for (const auto& [azimuth, elevation] : {std::array{0.0, 0.0}, {90.0, 0.0}, {230.0, 40.0}})
      expect_law(head, make_direction(azimuth, elevation), 2e-3, 0.5e-6);
  }
}

// The plain mean over the grid is close to the area-weighted mean here.
TEST_F(Sofa, LevelIsThatOfASphere) {
  double wanted = 0.0;
  for (int i = 0; i < 400; ++i)
    wanted += std::norm(calc_rigid_sphere(2.0 * std::numbers::pi * 600.0 * 0.0875 / 343.0, std::acos((2.0 * i + 1.0) / 400 - 1.0))) / 400;
  for (const char* options : {"level=1", "level=0.001", "rate=96000", "near=1"}) {
    const auto head = read_sofa(write("head.sofa", options), 48000.0);
    double power = 0.0;
    int count = 0;
    for (int elevation = -80; elevation <= 80; elevation += 20)
      for (int azimuth = 0; azimuth < 360; azimuth += 20, ++count)
        power += std::norm(calc_spectrum(hear_pulse(head, make_direction(azimuth, elevation)).left, 600.0, 48000.0, 0.0));
    EXPECT_NEAR(10.0 * std::log10(power / count / wanted), 0.0, 0.3) << options;
  }
}

TEST_F(Sofa, MissingPolesAreTheMeanOfTheNextRing) {
  const auto head = read_sofa(write("head.sofa", "low=-40 high=60"), 48000.0);
  expect_law(head, make_direction(90.0, -40.0), 2e-3, 0.3e-6);
  expect_law(head, {0.0, 0.0, -1.0}, 2e-3, 0.3e-6);
  const auto flat = read_sofa(write("flat.sofa", "low=0 high=0 step=5"), 48000.0);
  expect_law(flat, make_direction(65.0, 0.0), 2e-3, 0.3e-6);
  expect_law(flat, {0.0, 0.0, 1.0}, 2e-3, 0.3e-6);
}

TEST_F(Sofa, SilentTailsAreTruncated) {
  const auto head = read_sofa(write("head.sofa", "taps=1024 step=30"), 44100.0);
  EXPECT_LT(head->get_taps(), 64);
  EXPECT_GT(head->get_taps(), kOnset);
  expect_law(head, make_direction(90.0, 30.0), 3e-3, 0.5e-6);
}

TEST_F(Sofa, UnusableFilesAreRefusedByName) {
  const auto expect_refusal = [&](const std::string& options, const std::string& words) {
    const auto file = write("bad.sofa", options);
    const std::string said = find_refusal(file);
    EXPECT_TRUE(said.starts_with(file.string() + ": ")) << options << ": " << said;
    EXPECT_NE(said.find(words), std::string::npos) << options << ": " << said;
  };
  expect_refusal("convention=GeneralFIR", "SimpleFreeFieldHRIR");
  expect_refusal("type=odd", "coordinates");
  expect_refusal("fault=nan", "finite");
  expect_refusal("fault=short", "size");
  expect_refusal("fault=silent", "silent");
  expect_refusal("fault=late taps=2048 step=30", "delays differ");
  expect_refusal("taps=8193 step=45", "8192");
  expect_refusal("taps=4 step=1 low=-60 high=0", "20000");
  expect_refusal("span=90", "gap on the sphere");
  expect_refusal("rate=100", "sample rate");
  EXPECT_NE(find_refusal(write("long.sofa", "taps=8000 step=45"), 96000.0).find("96000"), std::string::npos);
  EXPECT_NE(find_refusal(write("good.sofa"), 10.0).find("sample rate"), std::string::npos);
}

TEST_F(Sofa, OtherFilesAreRefused) {
  EXPECT_NE(find_refusal(folder_ / "none.sofa").find("none.sofa"), std::string::npos);
  EXPECT_NE(find_refusal(folder_.path()), "");
  EXPECT_NE(find_refusal(folder_.write("empty.sofa", "")), "");
  EXPECT_NE(find_refusal(folder_.write("text.sofa", "this is a text and no head")), "");
  std::mt19937 chance(5);
  std::string noise = "\x89HDF\r\n\x1a\n";
  for (int i = 0; i < 5000; ++i) noise.push_back(static_cast<char>(chance()));
  EXPECT_NE(find_refusal(folder_.write("noise.sofa", noise)), "");
}

TEST_F(Sofa, TruncatedFilesAreRefused) {
  const std::string bytes = read_bytes(write("head.sofa", "step=30 taps=64"));
  ASSERT_GT(bytes.size(), 1000U);
  for (std::size_t i = 0; i < 60; ++i) {
    const std::size_t length = i < 20 ? i * 10 : bytes.size() * i / 60;
    EXPECT_NE(find_refusal(folder_.write("cut.sofa", bytes.substr(0, length))), "") << length;
  }
}

// Any changed byte: the file is read or refused.
TEST_F(Sofa, DamagedFilesAreReadOrRefused) {
  const std::string bytes = read_bytes(write("head.sofa", "step=30 taps=16"));
  std::mt19937 chance(3);
  int refused = 0;
  for (int i = 0; i < 400; ++i) {
    std::string damaged = bytes;
    for (int k = 0; k <= i % 3; ++k) damaged[chance() % damaged.size()] = static_cast<char>(chance());
    if (!find_refusal(folder_.write("damaged.sofa", damaged)).empty()) ++refused;
  }
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace carillon::head
