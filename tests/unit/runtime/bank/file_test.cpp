// Bank files: round trip, truncated and modified bytes, rows, killed writers and full disks.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <random>

#include "runtime/bank/reduce.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"
#include "tests/support/paths.hpp"
#include "tests/unit/runtime/bank/bank_arrays.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"
#include "tests/unit/runtime/bank/seal_again.hpp"

namespace carillon::bank {
namespace {

namespace fs = std::filesystem;

class BankFile : public testing::Test {
 protected:
  std::string message_of(const fs::path& file) const {
    return tests::catch_message<InputError>([&] { read_bank(file); });
  }
  void put(const std::string& bytes) const { std::ofstream(file_, std::ios::binary) << bytes; }
  std::string get() const {
    std::ifstream stream(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  std::size_t count_files() const { return std::distance(fs::directory_iterator(folder_), fs::directory_iterator()); }

  const tests::Folder scratch_;
  const fs::path& folder_ = scratch_.path();
  const fs::path file_ = folder_ / "bank.hdf";
};

void expect_equal(const Bank& a, const Bank& b) {
  EXPECT_EQ(a.vertices_m, b.vertices_m);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.eigenvalue_rad2_s2, b.eigenvalue_rad2_s2);
  EXPECT_EQ(a.decay_per_s, b.decay_per_s);
  EXPECT_EQ(a.residual, b.residual);
  EXPECT_EQ(a.radiation_gain, b.radiation_gain);
  EXPECT_EQ(a.shape_scale, b.shape_scale);
  EXPECT_EQ(a.shape, b.shape);
  EXPECT_EQ(a.rigid.mass_kg, b.rigid.mass_kg);
  EXPECT_EQ(a.rigid.centre_m, b.rigid.centre_m);
  EXPECT_EQ(a.rigid.inertia_kg_m2, b.rigid.inertia_kg_m2);
  EXPECT_EQ(a.rigid.volume_m3, b.rigid.volume_m3);
  EXPECT_EQ(a.material.young_modulus_pa, b.material.young_modulus_pa);
  EXPECT_EQ(a.material.poisson_ratio, b.material.poisson_ratio);
  EXPECT_EQ(a.material.density_kg_m3, b.material.density_kg_m3);
  EXPECT_EQ(a.material.alpha1_s, b.material.alpha1_s);
  EXPECT_EQ(a.material.alpha2_per_s, b.material.alpha2_per_s);
  EXPECT_EQ(a.counts.nodes, b.counts.nodes);
  EXPECT_EQ(a.counts.tets, b.counts.tets);
  EXPECT_EQ(a.counts.components, b.counts.components);
  EXPECT_EQ(a.counts.rigid_modes, b.counts.rigid_modes);
  EXPECT_EQ(a.band_hz, b.band_hz);
  EXPECT_EQ(a.complete, b.complete);
  EXPECT_EQ(a.element, b.element);
  EXPECT_EQ(a.mass, b.mass);
  EXPECT_EQ(a.provenance, b.provenance);
  EXPECT_EQ(a.algebraic_error_cents, b.algebraic_error_cents);
  EXPECT_EQ(a.discretisation_error_cents, b.discretisation_error_cents);
  EXPECT_EQ(a.damping.law, b.damping.law);
  EXPECT_EQ(a.damping.coefficient, b.damping.coefficient);
  EXPECT_EQ(a.damping.power, b.damping.power);
  EXPECT_EQ(a.damping.freq_hz, b.damping.freq_hz);
  EXPECT_EQ(a.damping.loss_factor, b.damping.loss_factor);
  EXPECT_EQ(a.regions, b.regions);
  EXPECT_EQ(a.supports.text, b.supports.text);
  EXPECT_EQ(a.supports.centre_m, b.supports.centre_m);
  EXPECT_EQ(a.supports.normal, b.supports.normal);
  EXPECT_EQ(a.supports.area_m2, b.supports.area_m2);
  EXPECT_EQ(a.supports.thickness_m, b.supports.thickness_m);
  EXPECT_EQ(a.supports.reaction, b.supports.reaction);
  EXPECT_EQ(a.supports.energy, b.supports.energy);
  ASSERT_EQ(a.proof.has_value(), b.proof.has_value());
  if (!a.proof) return;
  EXPECT_EQ(a.proof->cut_hz, b.proof->cut_hz);
  EXPECT_EQ(a.proof->below, b.proof->below);
  EXPECT_EQ(a.proof->margin, b.proof->margin);
  EXPECT_EQ(a.proof->rigid_per_component, b.proof->rigid_per_component);
  EXPECT_EQ(a.proof->found, b.proof->found);
  EXPECT_EQ(a.proof->orthonormality, b.proof->orthonormality);
  EXPECT_EQ(a.proof->backward_error, b.proof->backward_error);
  EXPECT_EQ(a.proof->cluster_first, b.proof->cluster_first);
  EXPECT_EQ(a.proof->cluster_count, b.proof->cluster_count);
  EXPECT_EQ(a.proof->method, b.proof->method);
}

/// Sines and roots of other libraries may differ in the last bit.
void expect_near(const Multipoles& a, const Multipoles& b) {
  ASSERT_EQ(a.order, b.order);
  ASSERT_EQ(a.coefficient.size(), b.coefficient.size());
  for (std::size_t i = 0; i < a.coefficient.size(); ++i) EXPECT_NEAR(a.coefficient[i], b.coefficient[i], 1);
  for (std::size_t m = 0; m < a.order.size(); ++m) {
    EXPECT_NEAR(a.freq_hz[m] / b.freq_hz[m], 1.0, 1e-12);
    EXPECT_NEAR(a.scale[m] / b.scale[m], 1.0, 1e-12);
    EXPECT_NEAR(a.decay_per_s[m] / b.decay_per_s[m], 1.0, 1e-12);
    EXPECT_NEAR(a.added_mass[m] / b.added_mass[m], 1.0, 1e-12);
    EXPECT_EQ(a.error_db[m], b.error_db[m]);
  }
  EXPECT_NEAR(a.radius_m / b.radius_m, 1.0, 1e-12);
  EXPECT_EQ(a.nearest_m, 1.5 * a.radius_m);
  EXPECT_EQ(a.air_density_kg_m3, b.air_density_kg_m3);
  EXPECT_EQ(a.sound_speed_ms, b.sound_speed_ms);
  EXPECT_EQ(a.method, b.method);
}

TEST_F(BankFile, ReadsBackExactly) {
  Bank bank = example::make_bank(4, 17);
  write_bank(bank, file_);
  expect_equal(read_bank(file_), bank);
  expect_equal(parse_bank(bytes_of(get())), bank);
  EXPECT_EQ(count_files(), 1u);

  bank = example::make_bank(3, 1);
  bank.complete = false;
  bank.element = "T4";
  bank.mass = "lumped";
  bank.provenance.clear();
  bank.material.alpha1_s = bank.material.alpha2_per_s = bank.decay_per_s[0] = 0.0;
  bank.proof->below[2] = 40;  // the band holds 33 more
  write_bank(bank, file_);    // replaces the other one
  expect_equal(read_bank(file_), bank);
  EXPECT_EQ(count_files(), 1u);
}

TEST_F(BankFile, AllLawsAndOptionalArraysReadBack) {
  Bank bank = example::make_first_bank(2, 4);
  write_bank(bank, file_);
  expect_equal(read_bank(file_), bank);

  bank = example::make_bank(2, 4);
  bank.algebraic_error_cents.clear();
  bank.proof->cluster_first = {2};
  bank.proof->cluster_count = {2};
  bank.eigenvalue_rad2_s2[2] = bank.eigenvalue_rad2_s2[3];
  bank.regions = R"([{"region": "body"}, {"region": "neck"}])";
  bank.material.alpha1_s = bank.material.alpha2_per_s = 0.0;
  bank.damping.law = "caughey";
  bank.damping.coefficient = {2.0, 1e-3};
  bank.damping.power = {0.0, 0.5};
  for (std::size_t i = 0; i < 4; ++i) bank.decay_per_s[i] = 1.0 + 0.5e-3 * std::sqrt(bank.eigenvalue_rad2_s2[i]);
  write_bank(bank, file_);
  expect_equal(read_bank(file_), bank);

  bank.damping = {};
  bank.damping.law = "loss_table";
  bank.damping.freq_hz = {100.0, 1000.0, 10000.0};
  bank.damping.loss_factor = {0.01, 0.02, 0.04};
  for (std::size_t i = 0; i < 4; ++i) {
    const double decades = std::log10(bank.freq_hz(i) / 100.0);  // rows are a decade apart
    const double eta = decades < 1 ? 0.01 + 0.01 * decades : decades < 2 ? 0.02 + 0.02 * (decades - 1) : 0.04;
    bank.decay_per_s[i] = eta * std::sqrt(bank.eigenvalue_rad2_s2[i]) / 2;
  }
  write_bank(bank, file_);
  expect_equal(read_bank(file_), bank);
}

TEST_F(BankFile, EveryReleasedVersionIsStillRead) {
  // Written by the first release of the version: make_example_bank version_1_0.hdf 1 2
  expect_equal(read_bank(carillon::tests::get_source_dir() + "/tests/unit/runtime/bank/pinned/version_1_0.hdf"),
               example::make_first_bank(1, 2));
  expect_equal(read_bank(carillon::tests::get_source_dir() + "/tests/unit/runtime/bank/pinned/version_1_1.hdf"), example::make_bank(1, 2));
  // carillon-bank edit version_1_1.hdf version_1_2.hdf --shape-bits 8
  expect_equal(read_bank(carillon::tests::get_source_dir() + "/tests/unit/runtime/bank/pinned/version_1_2.hdf"),
               calc_reduced(example::make_bank(1, 2), {.shape_bits = 8}));
  // make_example_bank version_1_3.hdf 1 2 supports
  expect_equal(read_bank(carillon::tests::get_source_dir() + "/tests/unit/runtime/bank/pinned/version_1_3.hdf"),
               example::make_supported_bank(1, 2));
  // make_example_bank version_1_4.hdf 1 6 corrected
  expect_equal(read_bank(carillon::tests::get_source_dir() + "/tests/unit/runtime/bank/pinned/version_1_4.hdf"),
               example::make_corrected_bank(1, 6));
  // make_example_bank version_1_5.hdf 1 4 radiation
  const Bank radiating = read_bank(carillon::tests::get_source_dir() + "/tests/unit/runtime/bank/pinned/version_1_5.hdf");
  expect_equal(radiating, example::make_radiating_bank(1, 4));
  expect_near(radiating.multipoles, example::make_radiating_bank(1, 4).multipoles);
  // carillon-bank pack version_1_5.hdf box_radiation.hdf --error -40
  expect_near(read_bank(carillon::tests::get_source_dir() + "/tests/unit/runtime/bank/packed/banks/box_radiation.hdf").multipoles,
              radiating.multipoles);
}

TEST_F(BankFile, SupportsReadBackAndRaiseTheVersion) {
  for (const std::size_t modes : {0u, 1u, 9u}) {
    write_bank(example::make_supported_bank(2, modes), file_);
    expect_equal(read_bank(file_), example::make_supported_bank(2, modes));
    EXPECT_EQ(read_version(file_), (std::array<int, 2>{1, 3}));
  }
  const Bank narrow = calc_reduced(example::make_supported_bank(2, 5), {.shape_bits = 8});
  write_bank(narrow, file_);
  expect_equal(read_bank(file_), narrow);
  write_bank(example::make_bank(2, 5), file_);
  EXPECT_EQ(read_version(file_), (std::array<int, 2>{1, 1})) << "as older readers know it";
}

TEST_F(BankFile, MayHoldNoModes) {
  const Bank bank = example::make_bank(2, 0);
  write_bank(bank, file_);
  expect_equal(read_bank(file_), bank);
}

TEST_F(BankFile, TheSameBankGivesTheSameBytes) {
  write_bank(example::make_bank(), file_);
  const std::string first = get();
  ::sleep(1);  // a time stamp would change
  write_bank(example::make_bank(), file_);
  EXPECT_TRUE(get() == first);
}

TEST_F(BankFile, AnyTruncationIsRejected) {
  write_bank(example::make_bank(), file_);
  const std::string whole = get();
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_THROW(parse_bank(bytes_of(whole).first(length)), InputError) << length;
  }
  for (std::size_t length = 0; length < whole.size(); length += 257) {
    put(whole.substr(0, length));
    const std::string message = message_of(file_);
    EXPECT_NE(message.find(length == 0 ? "empty" : "truncated"), std::string::npos) << message;
  }
  put(whole + "x");
  EXPECT_NE(message_of(file_).find("bytes were added"), std::string::npos);
}

TEST_F(BankFile, AnyChangedByteIsRejected) {
  write_bank(example::make_bank(), file_);
  std::string bytes = get();
  std::mt19937 random(1);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const char kept = bytes[i];
    bytes[i] = static_cast<char>(kept ^ (1 << (random() % 8)));
    EXPECT_THROW(parse_bank(bytes_of(bytes)), InputError) << "byte " << i;
    bytes[i] = kept;
  }
  EXPECT_NO_THROW(parse_bank(bytes_of(bytes)));
}

TEST_F(BankFile, AnyChangedHeaderByteIsRejected) {
  write_bank(example::make_bank(), file_);
  std::string bytes = get();
  for (std::size_t i = 0; i < 128; ++i) {
    const char kept = bytes[i];
    for (int value = 0; value < 256; ++value) {
      bytes[i] = static_cast<char>(value);
      if (bytes[i] == kept) continue;
      EXPECT_THROW(parse_bank(bytes_of(bytes)), InputError) << "byte " << i << " value " << value;
    }
    bytes[i] = kept;
  }
}

/// Bytes read by this process through read(2) and pread(2).
std::uint64_t read_so_far() {
  std::ifstream stream("/proc/self/io");
  std::string name;
  std::uint64_t bytes = 0;
  stream >> name >> bytes;  // "rchar: "
  return bytes;
}

TEST_F(BankFile, EveryByteIsReadOnce) {
  const Bank bank = example::make_bank(12, 100);
  write_bank(bank, file_);
  const std::uint64_t before = read_so_far();
  const Bank back = read_bank(file_);
  const std::uint64_t taken = read_so_far() - before;
  ASSERT_GT(before, 0u) << "/proc/self/io cannot be read";
  EXPECT_GT(fs::file_size(file_), 500'000u);
  EXPECT_LT(taken, fs::file_size(file_) + kSealBytes + 1024u) << "and the seal twice";
  EXPECT_EQ(back.shape, bank.shape);
}

TEST_F(BankFile, OverlappingArraysAreRejected) {
  write_bank(example::make_bank(), file_);
  std::string bytes = get();
  const auto find_offset = [&](const std::string& field) {
    const std::size_t begin = bytes.find("field " + field + " <f8 ") + ("field " + field + " <f8 ").size();
    return std::pair(begin, bytes.substr(begin, bytes.find(' ', begin) - begin));
  };
  const auto [place, offset] = find_offset("modes/decay");
  const auto [other_place, other] = find_offset("modes/residual");
  ASSERT_EQ(offset.size(), other.size());
  bytes.replace(place, offset.size(), other);
  put(seal_again(bytes));
  EXPECT_NE(message_of(file_).find("damaged seal: two arrays overlap"), std::string::npos) << message_of(file_);
}

TEST_F(BankFile, OtherFilesAreReported) {
  EXPECT_NE(message_of(folder_ / "none.hdf").find("no such file"), std::string::npos);
  EXPECT_NE(message_of(folder_).find("is a folder"), std::string::npos);
  EXPECT_NE(message_of("/dev/zero").find("not a regular file"), std::string::npos);
  const fs::path fifo = folder_ / "fifo";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  EXPECT_NE(message_of(fifo).find("not a regular file"), std::string::npos);
  put("");
  EXPECT_NE(message_of(file_).find("empty"), std::string::npos);
  put("{\"mesh\": \"bunny.msh\"}");
  EXPECT_NE(message_of(file_).find("not a Carillon bank"), std::string::npos);
  put("\x89HDF\r\n\x1a\n" + std::string(5000, '\0'));
  EXPECT_NE(message_of(file_).find("an HDF5 file of another kind"), std::string::npos);
}

TEST_F(BankFile, CannotBeWrittenToInvalidPaths) {
  const Bank bank = example::make_bank();
  EXPECT_THROW(write_bank(bank, folder_), InputError);
  EXPECT_THROW(write_bank(bank, ""), InputError);
  EXPECT_THROW(write_bank(bank, folder_ / "no folder" / "bank.hdf"), InputError);
  EXPECT_THROW(write_bank(bank, "/dev/null"), InputError);
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  EXPECT_THROW(write_bank(bank, "/proc/bank.hdf"), SystemError);
  EXPECT_EQ(count_files(), 0u);
}

TEST_F(BankFile, IsWrittenThroughALink) {
  write_bank(example::make_bank(1, 1), file_);
  fs::create_symlink("bank.hdf", folder_ / "link.hdf");
  write_bank(example::make_bank(2, 3), folder_ / "link.hdf");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link.hdf"));
  EXPECT_EQ(read_bank(file_).mode_count(), 3u);
}

/// Runs `work` in a child process; returns its exit code, or minus the terminating signal.
template <class Work>
pid_t start(Work work) {
  const pid_t child = ::fork();
  if (child == 0) {
    int code = 9;
    try {
      code = work();
    } catch (...) {
    }
    ::_exit(code);
  }
  return child;
}

int finish(pid_t child) {
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

TEST_F(BankFile, AFullDiskLeavesTheOldBankAndNothingElse) {
  const Bank old = example::make_bank(2, 3);
  write_bank(old, file_);
  const Bank larger = example::make_bank(12, 100);
  for (const rlim_t room : {0, 1, 4095, 100'000, 500'000}) {
    const int code = finish(start([&] {
      // A file size limit replaces a full disk: write(2) fails half-way.
      ::signal(SIGXFSZ, SIG_IGN);
      const rlimit limit{room, room};
      ::setrlimit(RLIMIT_FSIZE, &limit);
      try {
        write_bank(larger, file_);
      } catch (const SystemError&) {
        return 0;
      }
      return 1;
    }));
    EXPECT_EQ(code, 0) << room;
    expect_equal(read_bank(file_), old);
    EXPECT_EQ(count_files(), 1u) << room;
  }
}

TEST_F(BankFile, AKilledWriterLeavesAWholeBank) {
  const Bank a = example::make_bank(8, 60), b = example::make_bank(9, 50);
  write_bank(a, file_);
  std::mt19937 random(7);
  for (int round = 0; round < 25; ++round) {
    const pid_t child = start([&] {
      for (;;) {
        write_bank(b, file_);
        write_bank(a, file_);
      }
      return 0;
    });
    ::usleep(random() % 40'000);
    ::kill(child, SIGKILL);
    ASSERT_EQ(finish(child), -SIGKILL);
    const Bank bank = read_bank(file_);
    ASSERT_TRUE(bank.shape == a.shape || bank.shape == b.shape);
  }
  // A killed writer leaves at most a file of another name.
  for (const auto& entry : fs::directory_iterator(folder_)) {
    const std::string name = entry.path().filename();
    EXPECT_TRUE(name == "bank.hdf" || name.find(".tmp") != std::string::npos) << name;
  }
}

TEST_F(BankFile, TwoWritersAtOnceNeverMix) {
  const Bank a = example::make_bank(8, 60), b = example::make_bank(9, 50);
  write_bank(a, file_);
  const auto write_often = [&](const Bank& bank) {
    return start([&] {
      for (int i = 0; i < 30; ++i) write_bank(bank, file_);
      return 0;
    });
  };
  const pid_t first = write_often(a), second = write_often(b);
  for (int i = 0; i < 30; ++i) {
    const Bank bank = read_bank(file_);
    ASSERT_TRUE(bank.shape == a.shape || bank.shape == b.shape);
  }
  EXPECT_EQ(finish(first), 0);
  EXPECT_EQ(finish(second), 0);
  const Bank bank = read_bank(file_);
  EXPECT_TRUE(bank.shape == a.shape || bank.shape == b.shape);
  EXPECT_EQ(count_files(), 1u);
}

}  // namespace
}  // namespace carillon::bank
