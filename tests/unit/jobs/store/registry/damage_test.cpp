// A registry that is cut at any byte, or has any byte flipped, is noticed and made again from the store; nothing that the store knows is
// lost. Looked at are all bytes of the head of the file, those around the ends of its pages, and a sample of the others; all of them where
// the environment has CARILLON_EVERY_BYTE.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "tests/unit/jobs/store/registry/jobs.hpp"

namespace carillon::tests {
namespace {

using registry::Job;
using registry::JobState;
using registry::Registry;
namespace fs = std::filesystem;

/// Memory is a disk that needs no waiting.
fs::path find_fast_disk() { return ::access("/dev/shm", W_OK) == 0 ? fs::path("/dev/shm") : fs::temp_directory_path(); }

class Damage : public testing::Test {
 protected:
  Damage() : folder_(find_fast_disk()), store_(store::Store::open(folder_ / "store")) {
    Registry registry = Registry::open(store_, be_silent);
    for (int n = 0; n < 6; ++n) {
      make_work(store_, make_submission(n));
      registry.submit({make_submission(n)});
    }
    make_bank(store_, make_submission(0));
    store_.remove_work(make_id(0));
    registry.update(make_id(0), [](Job& job) { return job.state = JobState::done, true; });
    registry.update(make_id(1),
                    [](Job& job) { return job.state = JobState::failed, job.reason = "the mesh is bad", job.failures = 1, true; });
    registry.update(make_id(2), [](Job& job) { return job.state = JobState::cancelled, job.reason = "cancelled", true; });
    wanted_ = describe(registry);
  }

  fs::path file() const { return folder_ / "store/registry.sqlite"; }

  void put(const std::string& bytes) const {
    for (const auto& entry : fs::directory_iterator(folder_ / "store")) {
      if (entry.path().filename().string().starts_with("registry.")) fs::remove(entry.path());
    }
    folder_.write("store/registry.sqlite", bytes);
  }

  /// Opens what is there, and says whether it was made again.
  bool check(const std::string& what) const {
    int said = 0;
    const Registry registry = Registry::open(store_, [&](const std::string&) { ++said; });
    EXPECT_EQ(describe(registry), wanted_) << what;
    EXPECT_EQ(registry.list_last_submissions().size(), 6u) << what;
    EXPECT_LE(said, 1) << what;
    return said == 1;
  }

  const Folder folder_;
  const store::Store store_;
  std::string wanted_;
};

const bool kIsComplete = std::getenv("CARILLON_EVERY_BYTE") != nullptr;
const std::size_t kStep = kIsComplete ? 1 : 37, kEmptyStep = kIsComplete ? 5 : 151;
constexpr std::size_t kHeadBytes = 100, kPageBytes = 4096;  // of SQLite's file format

/// Whether the damage at this byte is tried; `step` 1: everywhere.
bool is_tried(std::size_t at, std::size_t step) {
  const std::size_t in_page = at % kPageBytes;
  return at < kHeadBytes || in_page < 12 || in_page > kPageBytes - 3 || at % step == 0;  // 12: the head of a page
}

/// The bytes of the file in shares, so that they are looked at side by side.
constexpr std::size_t kShares = 4;
class DamageShare : public Damage, public testing::WithParamInterface<std::size_t> {};
INSTANTIATE_TEST_SUITE_P(Shares, DamageShare, testing::Range<std::size_t>(0, kShares));

TEST_P(DamageShare, cut_at_any_byte) {
  const std::string whole = read_all(file());
  ASSERT_GT(whole.size(), 8000u);
  for (std::size_t length = GetParam(); length < whole.size(); length += kShares) {
    if (!is_tried(length, kStep)) continue;
    put(whole.substr(0, length));
    ASSERT_TRUE(check("cut at " + std::to_string(length))) << length;
    if (HasFailure()) return;
  }
  put(whole);
  EXPECT_FALSE(check("whole"));
}

TEST_P(DamageShare, any_byte_flipped) {
  const std::string whole = read_all(file());
  int made_again = 0;
  for (std::size_t at = GetParam(); at < whole.size(); at += kShares) {
    if (!is_tried(at, whole[at] != '\0' ? std::min<std::size_t>(kStep, 3) : kEmptyStep)) continue;
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << (at / kShares % 8)));
    put(bytes);
    made_again += check("flipped at " + std::to_string(at)) ? 1 : 0;
    if (HasFailure()) return;
  }
  EXPECT_GT(made_again, 100);
}

TEST_F(Damage, a_log_of_writes_cut_or_flipped_anywhere_costs_nothing) {
  // A copy made while the registry is in use has all of the latest changes in its write-ahead log.
  Registry registry = Registry::open(store_, be_silent);
  make_work(store_, make_submission(6));
  registry.submit({make_submission(6)});
  const std::string whole = read_all(file()), log = read_all(file().string() + "-wal");
  ASSERT_GT(log.size(), 4000u);
  const std::string wanted = describe(registry);
  const Folder other(find_fast_disk());
  // By hand: fs::copy makes the folders of banks first, with their mode, into which a plain user cannot write.
  fs::create_directory(other / "store");
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "store")) {
    const fs::path to = other / "store" / entry.path().lexically_relative(folder_ / "store");
    if (entry.is_directory()) {
      fs::create_directory(to);
    } else {
      fs::copy_file(entry.path(), to);
    }
  }
  const store::Store store = store::Store::open(other / "store");
  for (std::size_t at = 0; at < log.size(); at += 97) {
    for (const bool is_cut : {true, false}) {
      for (const auto& entry : fs::directory_iterator(other / "store")) {
        if (entry.path().filename().string().starts_with("registry.")) fs::remove(entry.path());
      }
      std::string bytes = is_cut ? log.substr(0, at) : log;
      if (!is_cut) bytes[at] = static_cast<char>(bytes[at] ^ 0x55);
      other.write("store/registry.sqlite", whole);
      other.write("store/registry.sqlite-wal", bytes);
      ASSERT_EQ(describe(Registry::open(store, be_silent)), wanted) << (is_cut ? "cut at " : "flipped at ") << at;
    }
  }
}

/// A rollback journal of no pages that names another file as its super journal (sqlite.org, fileformat2.html, section 3).
std::string make_journal(const std::string& super, std::uint32_t pages, std::uint32_t page_bytes) {
  const std::string magic("\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", 8);
  const auto number = [](std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xFF);
    return bytes;
  };
  std::string text = magic + number(0) + number(1) + number(pages) + number(512) + number(page_bytes);
  text.resize(512, '\0');
  std::uint32_t sum = 0;
  for (const char c : super) sum += static_cast<std::uint32_t>(static_cast<signed char>(c));
  return text + number((1U << 30) / page_bytes + 1) + super + number(static_cast<std::uint32_t>(super.size())) + number(sum) + magic;
}

TEST_F(Damage, a_journal_next_to_the_registry_removes_no_file_elsewhere) {
  std::string wanted;
  {
    Registry registry = Registry::open(store_, be_silent);
    wanted = describe(registry);
  }
  const std::string whole = read_all(file());
  const fs::path victim = folder_.write("victim/thesis.tex", "important");
  folder_.write("store/registry.sqlite-journal", make_journal(victim.string(), static_cast<std::uint32_t>(whole.size() / 4096), 4096));
  EXPECT_EQ(describe(Registry::open(store_, be_silent)), wanted);
  EXPECT_EQ(read_all(victim), "important");
  EXPECT_EQ(describe(Registry::open(store_, be_silent)), wanted);
}

TEST_F(Damage, a_link_next_to_the_registry_is_named) {
  for (const char* ending : {"-journal", "-wal", "-shm"}) {
    const fs::path link = folder_ / (std::string("store/registry.sqlite") + ending);
    fs::remove(link);
    fs::create_symlink(folder_.write("victim", "important"), link);
    try {
      Registry::open(store_, be_silent);
      ADD_FAILURE() << ending;
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find(link.string() + ": this is a link"), 0u) << error.what();
    }
    EXPECT_EQ(read_all(folder_ / "victim"), "important");
    fs::remove(link);
  }
}

TEST_F(Damage, what_is_damaged_is_kept_next_to_the_new_one) {
  put("this is no database, but it is long enough to be taken for one, if its first bytes are not looked at: " + std::string(5000, 'x'));
  EXPECT_TRUE(check("text"));
  EXPECT_TRUE(fs::exists(folder_ / "store/registry.damaged-1.sqlite"));
  EXPECT_FALSE(check("the new one"));
}

TEST_F(Damage, a_registry_in_use_that_is_taken_away_is_made_again_under_the_hands_of_its_user) {
  Registry registry = Registry::open(store_, be_silent);
  fs::remove(file());
  EXPECT_EQ(describe(registry), wanted_);
  EXPECT_TRUE(registry.update(make_id(3), [](Job& job) { return job.state = JobState::failed, job.reason = "x", true; }));
  EXPECT_EQ(Registry::open(store_, be_silent).find(make_id(3))->state, JobState::failed);
}

TEST_F(Damage, a_pipe_or_a_folder_in_its_place_is_one_clear_error) {
  put("");
  fs::remove(file());
  fs::create_directory(file());
  EXPECT_THROW(Registry::open(store_, be_silent), InputError);
}

}  // namespace
}  // namespace carillon::tests
