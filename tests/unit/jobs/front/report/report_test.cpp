// Data of a report, and the record of a run.
#include "jobs/front/report/report.hpp"

#include <gtest/gtest.h>

#include "jobs/front/report/figures.hpp"
#include "jobs/front/report/record.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::report {
namespace {

TEST(Record, file_before_the_copy_in_the_bank) {
  const tests::Folder folder;
  const std::string bank = R"({"mesh": "bank.msh", "run": {"ranks": 1}})";
  const Record whole = read_record(folder.write("a.json", R"({"mesh": "file.msh", "run": {"ranks": 2}})"), bank);
  EXPECT_EQ(find_text(whole.job, "mesh"), "file.msh");
  EXPECT_EQ(whole.run["ranks"].as_double(), 2);
  EXPECT_TRUE(whole.remarks.empty());
  const Record without_run = read_record(folder.write("b.json", R"({"mesh": "file.msh"})"), bank);
  EXPECT_EQ(find_text(without_run.job, "mesh"), "file.msh");
  EXPECT_EQ(without_run.run["ranks"].as_double(), 1);
  EXPECT_EQ(without_run.remarks.size(), 2u);
  for (const std::string& text : {std::string(), std::string("[1]"), std::string("{\"a\":"), std::string(100000, '[')}) {
    const Record damaged = read_record(folder.write("c.json", text), bank);
    EXPECT_EQ(find_text(damaged.job, "mesh"), "bank.msh");
    EXPECT_FALSE(damaged.remarks.empty());
  }
  const Record none = read_record("", "");
  EXPECT_TRUE(none.job.is_null() && none.run.is_null());
}

TEST(Report, page_holds_the_data_without_markup) {
  const tests::Folder folder;
  const bank::Bank bank = bank::example::make_mounted_bank();
  bank::write_bank(bank, folder / "b.hdf");
  std::string provenance;
  const base::Json figures = make_figures(folder / "b.hdf", provenance);
  EXPECT_EQ(figures["modes"]["freq_hz"].size(), bank.mode_count());
  EXPECT_EQ(figures["checks"].empty(), false);
  const std::string job = R"({"mesh": "</script><script>alert(1)</script>\u202e", "run": {}})";
  write_report(folder / "b.hdf", folder.write("j.json", job), folder / "out", {.title = "", .drawn_modes = 0});
  const std::string page = tests::read_all(folder / "out/report.html");
  EXPECT_EQ(page.find("alert(1)</script>"), std::string::npos);
  EXPECT_NE(page.find("\\u003cscript>alert(1)"), std::string::npos);
  EXPECT_NE(page.find("\\\\u202e"), std::string::npos);
  for (const char* mark : {"{{STYLE}}", "{{DATA}}", "{{SCRIPT}}"}) EXPECT_EQ(page.find(mark), std::string::npos) << mark;
  EXPECT_THROW(write_report(folder / "j.json", "", folder / "none", {}), InputError);
}

}  // namespace
}  // namespace carillon::report
