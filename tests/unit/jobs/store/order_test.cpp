// Parts of ids of simulations, and their jobs in the store.
#include "jobs/store/order.hpp"

#include <gtest/gtest.h>

#include <set>

#include "jobs/store/identity.hpp"
#include "precompute/job/simulation.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/jobs/store/ids.hpp"

namespace {

using namespace carillon;
using carillon::tests::Folder;
using store::testing::kMaterial;
using store::testing::kSolver;

constexpr const char* kSimulator = "carillon-simulate 0.1.0 (abc)";

std::string simulation_of(const std::string& mesh, const std::string& simulate = "", const std::string& rest = ", \"sound\": \"a.wav\"") {
  return "{\"simulate\": {\"duration_s\": 0.25, \"bodies\": [{\"name\": \"a\", \"mesh\": \"" + mesh + "\", " + kMaterial + "}]" + simulate +
         "}" + rest + "}";
}

std::string find_order_id(const std::filesystem::path& job, const std::string& simulator = kSimulator) {
  return store::RequestMaker(kSolver, simulator).make(store::read_order(job)).id;
}

TEST(Order, equivalent_jobs_have_the_same_id) {
  const Folder folder;
  folder.write("m.msh", "$MeshFormat\n");
  folder.write("elsewhere/deep/other name.msh", "$MeshFormat\n");
  const std::string id = find_order_id(folder.write("a.json", simulation_of("m.msh")));
  const std::pair<const char*, std::string> same[] = {
      {"another folder", "elsewhere/deep/a.json|" + simulation_of("other name.msh")},
      {"other names of files", "b.json|" + simulation_of("m.msh", "", ", \"sound\": \"x/y.wav\"")},
      {"a record", "b.json|" + simulation_of("m.msh", "", ", \"sound\": \"a.wav\", \"record\": \"a.json5\"")},
      {"resources", "b.json|" + simulation_of("m.msh", "", ", \"sound\": \"a.wav\", \"resources\": {\"ranks\": 3}")},
      {"comments", "b.json|// a job\n" + simulation_of("m.msh", " // here\n")},
  };
  store::testing::expect_same(
      folder, [](const auto& job) { return find_order_id(job); }, id, same);
}

TEST(Order, changed_jobs_have_other_ids) {
  const Folder folder;
  folder.write("m.msh", "$MeshFormat\n");
  folder.write("n.msh", "$MeshFormat \n");
  std::string longer = simulation_of("m.msh"), denser = longer;
  longer.replace(longer.find("0.25"), 4, "0.26");
  denser.replace(denser.find("2700"), 4, "2701");
  const std::pair<const char*, std::string> others[] = {
      {"as it is", simulation_of("m.msh")},
      {"mesh", simulation_of("n.msh")},
      {"duration", longer},
      {"density", denser},
      {"gravity", simulation_of("m.msh", ", \"gravity_m_s2\": [0, 0, -9.81]")},
      {"another file", simulation_of("m.msh", "", ", \"motion\": \"a.vtkhdf\"")},
      {"a picture", simulation_of("m.msh", "", ", \"sound\": \"a.wav\", \"spectrogram\": \"a.png\"")},
      {"one more file", simulation_of("m.msh", "", ", \"sound\": \"a.wav\", \"motion\": \"a.vtkhdf\"")},
  };
  auto ids = store::testing::expect_different(
      folder, [](const auto& job) { return find_order_id(job); }, others);
  EXPECT_TRUE(ids.insert(find_order_id(folder.write("a.json", simulation_of("m.msh")), "carillon-simulate 0.2.0 (abc)")).second);
}

TEST(Order, work_uses_the_inputs_in_the_store) {
  const Folder folder;
  folder.write("m.msh", "$MeshFormat\n");
  const store::Store store = store::Store::open(folder / "store");
  const store::JobOrder order = store::read_order(folder.write("a.json", simulation_of("m.msh")));
  const store::Request request = store::RequestMaker(kSolver, kSimulator).make(order);
  EXPECT_EQ(request.solver, kSimulator);
  EXPECT_EQ(store::prepare_work(store, {{&order, &request}}), std::vector<bool>{true});
  folder.write("m.msh", "something else by now");
  const store::Id id = store::require_id(request.id, "test");
  const std::filesystem::path work = store.work_folder(id);
  EXPECT_EQ(store::find_job_fault(store, id), std::nullopt);
  const std::string text = tests::read_all(work / store::kJobFile);
  const job::SimulationSpec inner = job::parse_simulation(text, work / store::kJobFile);
  EXPECT_EQ(inner.duration_s, 0.25);
  EXPECT_EQ(tests::read_all(inner.bodies.at(0).mesh), "$MeshFormat\n");
  EXPECT_TRUE(inner.bodies[0].mesh.string().starts_with((folder / "store/inputs").string())) << inner.bodies[0].mesh;
  EXPECT_EQ(inner.sound, work / "sound.wav");
  EXPECT_EQ(inner.record, work / store::kRecordFile);
  EXPECT_TRUE(inner.motion.empty());
  // Rebuilt from the request: bitwise equal.
  store.remove_work(id);
  EXPECT_TRUE(store::restore_work(store, request));
  EXPECT_EQ(tests::read_all(work / store::kJobFile), text);
  // A changed digit is detected.
  std::string changed = text;
  changed.replace(changed.find("0.25"), 4, "0.24");
  folder.write(work.lexically_relative(folder / "").string() + "/" + store::kJobFile, changed);
  EXPECT_NE(store::find_job_fault(store, id), std::nullopt);
}

TEST(Order, a_record_belongs_to_the_bytes_of_a_job) {
  // printf a | sha256sum
  constexpr const char* kSha256OfA = "ca978112ca1bbdcafac231b39a23dc4da786eff8147c4e72b9807785afee48bb";
  const std::string record = std::string("{\"job_sha256\": \"") + kSha256OfA + "\"}";
  EXPECT_EQ(store::find_record_fault(record, "a"), std::nullopt);
  EXPECT_NE(store::find_record_fault(record, "b"), std::nullopt);
  for (const char* broken : {"", "{", "[]", "{}", "{\"job_sha256\": 1}", "null"})
    EXPECT_NE(store::find_record_fault(broken, "a"), std::nullopt) << broken;
}

TEST(Order, invalid_jobs_are_refused_with_their_line) {
  const Folder folder;
  folder.write("m.msh", "$MeshFormat\n");
  EXPECT_THROW(store::read_order(folder.write("a.json", simulation_of("m.msh", "", ""))), InputError);
  tests::expect_error<InputError>(
      {"list.txt:7"}, [&] { (void)store::parse_order(simulation_of("m.msh", ", \"gravty_m_s2\": [0, 0, 1]"), folder / "list.txt", 7); });
}

}  // namespace
