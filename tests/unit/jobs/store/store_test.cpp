#include "jobs/store/store.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>

#include "jobs/store/files.hpp"
#include "runtime/base/file.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"

namespace {

using namespace carillon;
using carillon::tests::Folder;
namespace fs = std::filesystem;

const store::Id kId = *store::parse_id(std::string(64, 'a'));

void write_bank(const fs::path& folder, const std::string& text) { std::ofstream(folder / store::kBankFile) << text; }

unsigned mode_of(const fs::path& path) {
  struct stat info {};
  return ::stat(path.c_str(), &info) == 0 ? info.st_mode & 07777U : 0;
}

TEST(Store, published_bank_is_complete_and_read_only) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  store::Temporary made = store.make_temporary();
  write_bank(made.path(), "bank");
  fs::create_directory(made / "pictures");
  std::ofstream(made / "pictures/a.png") << "png";
  EXPECT_FALSE(store.has_bank(kId));
  EXPECT_TRUE(store.publish(kId, made));
  EXPECT_TRUE(store.has_bank(kId));
  EXPECT_EQ(store.list_banks(), std::vector<store::Id>{kId});
  EXPECT_EQ(mode_of(store.bank_folder(kId)) & 0222U, 0u);
  EXPECT_EQ(mode_of(store.bank_folder(kId) / store::kBankFile), 0444u);
  EXPECT_EQ(mode_of(store.bank_folder(kId) / "pictures") & 0222U, 0u);
  store.remove_bank(kId);
  EXPECT_FALSE(store.has_bank(kId));
  EXPECT_TRUE(fs::is_empty(folder / "store/tmp"));
}

TEST(Store, second_publication_changes_nothing) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  for (const char* text : {"first", "second"}) {
    store::Temporary made = store.make_temporary();
    write_bank(made.path(), text);
    EXPECT_EQ(store.publish(kId, made), std::string(text) == "first");
  }
  EXPECT_EQ(tests::read_all(store.bank_folder(kId) / store::kBankFile), "first");
}

TEST(Store, concurrent_publications_by_eight_processes) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  std::vector<pid_t> children;
  for (int n = 0; n < 8; ++n) {
    const pid_t child = ::fork();
    if (child == 0) {
      int won = 0;
      for (int round = 0; round < 20; ++round) {
        store::Temporary made = store.make_temporary();
        write_bank(made.path(), std::string(1000, static_cast<char>('a' + n)));
        won += store.publish(*store::parse_id(std::string(62, 'c') + (round < 10 ? "0" : "1") + std::to_string(round % 10)), made) ? 1 : 0;
      }
      ::_exit(won);
    }
    children.push_back(child);
  }
  int won = 0;
  for (const pid_t child : children) {
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status));
    won += WEXITSTATUS(status);
  }
  EXPECT_EQ(won, 20);
  EXPECT_EQ(store.list_banks().size(), 20u);
  for (const store::Id& id : store.list_banks()) {
    const std::string bank = tests::read_all(store.bank_folder(id) / store::kBankFile);
    EXPECT_EQ(bank, std::string(1000, bank.at(0)));
  }
  EXPECT_TRUE(fs::is_empty(folder / "store/tmp"));
}

TEST(Store, other_folders_are_refused) {
  const Folder folder;
  folder.write("home/letter.txt", "dear");
  EXPECT_THROW(store::Store::open(folder / "home"), InputError);
  EXPECT_FALSE(fs::exists(folder / "home/banks"));
  folder.write("file", "");
  EXPECT_THROW(store::Store::open(folder / "file"), InputError);
  EXPECT_THROW(store::Store::open(""), InputError);
  store::Store::open(folder / "store");
  folder.write("store/VERSION", "carillon store 2\n");
  tests::expect_error<InputError>({"carillon store 2"}, [&] { store::Store::open(folder / "store"); });
}

TEST(Store, other_names_in_its_folders_are_skipped) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  fs::create_directories(folder / "store/banks/aa/not-an-id");
  fs::create_directories(folder / ("store/banks/bb/" + kId.text()));  // in the wrong shard
  EXPECT_TRUE(store.list_banks().empty());
}

TEST(Store, group_store_is_writable_with_any_umask) {
  const Folder folder;
  fs::create_directory(folder / "store");
  ::chmod((folder / "store").c_str(), 02775);
  const pid_t child = ::fork();
  if (child == 0) {
    ::umask(077);
    const store::Store store = store::Store::open(folder / "store");
    const bool is_good = (mode_of(folder / "store/work") & 070U) == 070U && (mode_of(store.make_temporary().path()) & 070U) == 070U;
    ::_exit(is_good ? 0 : 1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
}

TEST(Store, removal_does_not_follow_links) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  folder.write("victim/thesis.tex", "important");
  const fs::path work = store.work_folder(kId);
  fs::create_directories(work / "inner/deep");
  fs::create_directory_symlink(folder / "victim", work / "inner/deep/link");
  fs::create_symlink(folder / "victim/thesis.tex", work / "log");
  fs::permissions(work / "inner", fs::perms::owner_read);
  store.remove_work(kId);
  EXPECT_FALSE(fs::exists(work));
  EXPECT_EQ(tests::read_all(folder / "victim/thesis.tex"), "important");
}

TEST(Store, damaged_bank_is_detected) {
  const auto spoil = [](const std::function<void(const fs::path&)>& act, store::Look look, bool keeps_time) {
    const Folder folder;
    const store::Store store = store::Store::open(folder / "store");
    store::Temporary made = store.make_temporary();
    write_bank(made.path(), std::string(9000, 'x'));
    EXPECT_TRUE(store.publish(kId, made));
    EXPECT_FALSE(store.find_bank_fault(kId, store::Look::full));
    const fs::path bank = store.bank_folder(kId) / store::kBankFile;
    fs::permissions(bank.parent_path(), fs::perms::owner_all);
    fs::permissions(bank, fs::perms::owner_all);
    const auto time = fs::last_write_time(bank);
    act(bank);
    if (keeps_time) fs::last_write_time(bank, time);
    const auto fault = store.find_bank_fault(kId, look);
    // A fault found once is found by every later quick look.
    return fault && store.find_bank_fault(kId, store::Look::quick);
  };
  const auto flip = [](const fs::path& bank) {
    std::fstream file(bank, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(8000);
    file.put('y');
  };
  EXPECT_TRUE(spoil([](const fs::path& bank) { fs::remove(bank); }, store::Look::quick, false));
  EXPECT_TRUE(spoil([](const fs::path& bank) { fs::resize_file(bank, 0); }, store::Look::quick, false));
  EXPECT_TRUE(spoil([](const fs::path& bank) { fs::resize_file(bank, 8999); }, store::Look::quick, true));
  EXPECT_TRUE(spoil([](const fs::path& bank) { std::ofstream(bank) << std::string(9000, 'z'); }, store::Look::quick, true));
  EXPECT_TRUE(spoil(flip, store::Look::quick, false));
  EXPECT_TRUE(spoil(flip, store::Look::full, true));
}

TEST(Store, full_quota_is_a_full_disk) {
  for (const int error : {ENOSPC, EDQUOT}) {
    EXPECT_TRUE(base::is_full_error(error));
    try {
      store::throw_errno("/some/file", "write", error);
    } catch (const SystemError& refusal) {
      const std::string what = refusal.what();
      EXPECT_NE(what.find("/some/file: cannot write"), std::string::npos) << what;
      EXPECT_NE(what.find("the disk or quota is full: make room"), std::string::npos) << what;
      EXPECT_TRUE(store::is_disk_full("/proc", refusal)) << what;
    }
  }
  EXPECT_FALSE(base::is_full_error(EACCES));
  const Folder folder;
  EXPECT_EQ(store::is_disk_full(folder.path(), SystemError(std::strerror(ENOSPC))),
            store::is_disk_full(folder.path()));  // only the type counts
}

TEST(Store, messages_for_missing_locks_and_file_size_limits) {
  for (const auto& [error, words] : {std::pair{ENOLCK, "this file system keeps no locks"}, {EFBIG, "ulimit -f"}}) {
    try {
      store::throw_errno("/some/file", "lock", error);
    } catch (const SystemError& refusal) {
      const std::string what = refusal.what();
      EXPECT_NE(what.find(words), std::string::npos) << what;
      EXPECT_EQ(what.find("check the disk"), std::string::npos) << what;
    }
  }
}

TEST(Store, names_of_temporary_folders) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  store::Temporary made = store.make_temporary();
  for (const auto& entry : fs::directory_iterator(folder / "store/tmp"))
    EXPECT_TRUE(store::Store::is_temporary_name(entry.path().filename().string())) << entry.path();
  for (const char* name : {"thesis.tex", ".ssh", "a,b,c,d,e", "host,0-1:2,12,34,0123456789ab,", "host,0-1:2,12,34,0123456789aX", ""})
    EXPECT_FALSE(store::Store::is_temporary_name(name)) << name;
}

TEST(Store, user_without_rights_gets_the_owner) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root becomes another user";
  const Folder folder;
  ::chmod(folder.path().c_str(), 0755);
  store::Store::open(folder / "store");
  const pid_t child = ::fork();
  if (child == 0) {
    if (::setgid(65534) != 0 || ::setuid(65534) != 0) ::_exit(9);
    try {
      store::Store::open(folder / "store");
    } catch (const InputError& error) {
      const std::string what = error.what();
      ::_exit(what.find("may not write") != std::string::npos && what.find("install -d -m 2775") != std::string::npos ? 0 : 2);
    }
    ::_exit(1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
}

}  // namespace
