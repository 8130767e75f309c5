// Parts of ids. File hashes are compared with sha256sum.
#include "jobs/store/identity.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <set>

#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/jobs/store/ids.hpp"

namespace {

using namespace carillon;
using carillon::tests::Folder;
using store::testing::kMaterial;
using store::testing::kSolver;

std::string find_id(const std::filesystem::path& job, const std::string& solver = kSolver) {
  return store::RequestMaker(solver).make(job::read_job(job, job::BankKey::optional)).id;
}

std::string job_with(const std::string& mesh, const std::string& rest) { return "{\"mesh\": \"" + mesh + "\", " + kMaterial + rest + "}"; }

TEST(Identity, equivalent_requests_have_the_same_id) {
  const Folder folder;
  folder.write("m.msh", "$MeshFormat\n");
  folder.write("elsewhere/deep/other name.msh", "$MeshFormat\n");
  const std::string id = find_id(folder.write("a.json", job_with("m.msh", "")));
  const std::pair<const char*, std::string> same[] = {
      {"another folder", "elsewhere/deep/a.json|" + job_with("other name.msh", "")},
      {"another path to the mesh", "b.json|" + job_with("./elsewhere/../m.msh", "")},
      {"a bank's name", "b.json|" + job_with("m.msh", ", \"bank\": \"x.hdf\"")},
      {"resources", "b.json|" + job_with("m.msh", ", \"resources\": {\"ranks\": 7, \"memory_gb\": 3, \"time_limit_s\": 60}")},
      {"defaults written out", "b.json|" + job_with("m.msh", ", \"element\": \"T10\", \"mass\": \"consistent\", \"band_hz\": [20, 20000]")},
      {"comments and blanks", "b.json|// a job\n" + job_with("m.msh", " // here\n\n  ")},
      {"numbers in other words",
       "b.json|" + job_with("m.msh", ", \"band_hz\": [2.0e1, 20000.000], \"solver\": {\"tolerance\": 0.00000001}")},
      {"a record of a run", "b.json|" + job_with("m.msh", ", \"run\": {\"ranks\": 3}")},
      {"another order",
       "b.json|{\"material\": {\"damping\": {\"rayleigh\": {\"alpha2_per_s\": 0.5, \"alpha1_s\": 1e-7}}, \"density_kg_m3\": 2.7e3, "
       "\"poisson_ratio\": 0.33, "
       "\"young_modulus_pa\": 70e9}, \"mesh\": \"m.msh\"}"},
  };
  store::testing::expect_same(
      folder, [](const auto& job) { return find_id(job); }, id, same);
}

TEST(Identity, changed_inputs_have_other_ids) {
  const Folder folder;
  folder.write("m.msh", "$MeshFormat\n");
  folder.write("n.msh", "$MeshFormat \n");
  const std::pair<const char*, std::string> others[] = {
      {"as it is", job_with("m.msh", "")},
      {"mesh", job_with("n.msh", "")},
      {"element", job_with("m.msh", ", \"element\": \"T4\"")},
      {"mass", job_with("m.msh", ", \"mass\": \"lumped\"")},
      {"low", job_with("m.msh", ", \"band_hz\": [21, 20000]")},
      {"high", job_with("m.msh", ", \"band_hz\": [20, 20000.000000001]")},
      {"modes", job_with("m.msh", ", \"max_modes\": 7")},
      {"fixed", job_with("m.msh", ", \"fixed\": \"x-min\"")},
      {"tolerance", job_with("m.msh", ", \"solver\": {\"tolerance\": 1e-9}")},
      {"method", job_with("m.msh", ", \"solver\": {\"method\": \"krylov-schur\"}")},
      {"factorisation", job_with("m.msh", ", \"solver\": {\"factorisation\": \"mumps\"}")},
      {"accuracy", job_with("m.msh", ", \"accuracy_cents\": 5")},
      {"regions", job_with("m.msh", ", \"materials\": {\"1\": " + std::string(kMaterial).substr(12) + "}")},
      {"shape", "{\"body\": {\"shape\": \"bar\", \"length_m\": 0.1}, " + std::string(kMaterial) + "}"},
      {"longer shape", "{\"body\": {\"shape\": \"bar\", \"length_m\": 0.2}, " + std::string(kMaterial) + "}"},
      {"surface", "{\"body\": {\"surface\": \"m.msh\"}, " + std::string(kMaterial) + "}"},
  };
  std::map<std::string, std::string> ids;
  for (const auto& [what, text] : others) {
    const std::string id = find_id(folder.write("job.json", text));
    EXPECT_EQ(id.size(), 64u);
    EXPECT_TRUE(ids.emplace(id, what).second) << what << " has the id of " << ids[id];
  }
  const std::filesystem::path job = folder.write("job.json", job_with("m.msh", ""));
  EXPECT_TRUE(ids.emplace(find_id(job, "carillon-precompute 0.1.0 (abd)"), "solver").second);
  std::string softer = job_with("m.msh", "");
  softer.replace(softer.find("7e10"), 4, "6e10");
  EXPECT_TRUE(ids.emplace(find_id(folder.write("job.json", softer)), "material").second);
}

TEST(Identity, TetGen_pairs_by_either_name) {
  const Folder folder;
  folder.write("t.node", "nodes");
  folder.write("t.ele", "elements");
  const std::string id = find_id(folder.write("a.json", job_with("t.node", "")));
  EXPECT_EQ(find_id(folder.write("b.json", job_with("t.ele", ""))), id);
  folder.write("t.ele", "other elements");
  EXPECT_NE(find_id(folder / "a.json"), id);
  std::filesystem::remove(folder / "t.ele");
  EXPECT_THROW(find_id(folder / "a.json"), InputError);
}

TEST(Identity, changed_mesh_is_hashed_again) {
  const Folder folder;
  const auto job = folder.write("a.json", job_with("m.msh", ""));
  folder.write("m.msh", "first");
  store::RequestMaker maker(kSolver);
  const std::string before = maker.make(job::read_job(job, job::BankKey::optional)).input_sha256;
  folder.write("m.msh", "later");
  EXPECT_NE(maker.make(job::read_job(job, job::BankKey::optional)).input_sha256, before);
}

TEST(Identity, included_files_count_and_are_copied) {
  const Folder folder;
  const auto file = folder.write("a.json", job_with("m.inp", ""));
  folder.write("m.inp", "*INCLUDE, INPUT=parts/n.inc\n** end\n");
  folder.write("parts/n.inc", "*NODE\n1, 0, 0, 0\n");
  store::RequestMaker maker(kSolver);
  const job::JobSpec job = job::read_job(file, job::BankKey::optional);
  const store::Request request = maker.make(job);
  const store::Store store = store::Store::open(folder / "store");
  const store::JobOrder order(job);
  EXPECT_EQ(store::prepare_work(store, {{&order, &request}}), std::vector<bool>{true});
  const job::JobSpec inner = job::read_job(store.work_folder(store::require_id(request.id, "test")) / store::kJobFile);
  EXPECT_EQ(tests::read_all(inner.mesh), "*NODE\n1, 0, 0, 0\n** end\n");
  EXPECT_EQ(inner.mesh.extension(), ".inp");
  folder.write("parts/n.inc", "*NODE\n1, 0, 0, 1\n");
  EXPECT_NE(maker.make(job).id, request.id);
}

TEST(Identity, hashes_equal_sha256sum) {
  // printf abc | sha256sum, FIPS 180-4 appendix B.1; printf '' | sha256sum.
  EXPECT_EQ(store::hash_text("abc").text(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(store::hash_text("").text(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  const Folder folder;
  EXPECT_EQ(store::hash_file(folder.write("abc", "abc"), "mesh").text(), store::hash_text("abc").text());
  const std::string large(3 * (1 << 20) + 17, 'x');  // more than one piece
  EXPECT_EQ(store::hash_file(folder.write("large", large), "mesh"), store::hash_text(large));
}

TEST(Identity, pipes_and_missing_files_are_refused) {
  const Folder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe.msh").c_str(), 0600), 0);
  std::filesystem::create_symlink("loop.msh", folder / "loop.msh");
  std::filesystem::create_directory(folder / "folder.msh");
  const std::pair<const char*, const char*> table[] = {{"pipe.msh", "regular file"},
                                                       {"loop.msh", "symbolic links"},
                                                       {"folder.msh", "folder"},
                                                       {"none.msh", "No such file"},
                                                       {"/dev/zero", "device"}};
  for (const auto& [mesh, words] : table) {
    tests::expect_error<InputError>({words, mesh}, [&] { find_id(folder.write("job.json", job_with(mesh, ""))); });
  }
}

TEST(Identity, work_uses_the_inputs_in_the_store) {
  const Folder folder;
  folder.write("m.msh", "$MeshFormat\n");
  const store::Store store = store::Store::open(folder / "store");
  const job::JobSpec job = job::read_job(folder.write("a.json", job_with("m.msh", "")), job::BankKey::optional);
  const store::Request request = store::RequestMaker(kSolver).make(job);
  const store::JobOrder order(job);
  EXPECT_EQ(store::prepare_work(store, {{&order, &request}}), std::vector<bool>{true});
  EXPECT_EQ(store::prepare_work(store, {{&order, &request}}), std::vector<bool>{false});
  folder.write("m.msh", "something else by now");
  const store::Id id = store::require_id(request.id, "test");
  const job::JobSpec inner = job::read_job(store.work_folder(id) / store::kJobFile);
  EXPECT_EQ(tests::read_all(inner.mesh), "$MeshFormat\n");
  EXPECT_TRUE(inner.mesh.string().starts_with((folder / "store/inputs").string())) << inner.mesh;
  EXPECT_EQ(inner.bank, store.work_folder(id) / store::kBankFile);
  EXPECT_EQ(store::make_canonical_job(inner), request.job);
  struct stat info {};
  ASSERT_EQ(::stat(inner.mesh.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0222U, 0u);
  EXPECT_TRUE(std::filesystem::is_empty(folder / "store/tmp"));
}

TEST(Identity, input_changed_after_hashing_is_refused) {
  const Folder folder;
  folder.write("m.msh", "before");
  const store::Store store = store::Store::open(folder / "store");
  const job::JobSpec job = job::read_job(folder.write("a.json", job_with("m.msh", "")), job::BankKey::optional);
  const store::Request request = store::RequestMaker(kSolver).make(job);
  folder.write("m.msh", "after");
  const store::JobOrder order(job);
  EXPECT_THROW(store::prepare_work(store, {{&order, &request}}), InputError);
  EXPECT_FALSE(store.has_work(store::require_id(request.id, "test")));
  EXPECT_TRUE(std::filesystem::is_empty(folder / "store/tmp"));
}

}  // namespace
