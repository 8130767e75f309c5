// Tables of measured modes: accepted input, and errors with line numbers.
#include "precompute/analytic/measured.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "precompute/analytic/make_bank.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/analytic/bodies.hpp"

namespace carillon::analytic {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Table : public testing::Test {
 protected:
  Table() : file_(fs::temp_directory_path() / ("carillon-modes-" + std::to_string(::getpid()) + ".csv")) {}
  ~Table() override { fs::remove(file_); }
  void write(const std::string& text) const { std::ofstream(file_, std::ios::binary) << text; }
  std::string find_fault(const std::string& text) const {
    write(text);
    return tests::catch_message<InputError>([&] { (void)read_modes_table(file_); });
  }
  const fs::path file_;
};

TEST_F(Table, is_read_in_the_order_of_its_frequencies) {
  write("# a bell\n\"frequency_hz\", t60_s, 0 0 0.05, 0.05 0 0\r\n880,1.5,2,-1\n440, 3, 1, 0.5\n\n");
  const ModesTable table = read_modes_table(file_);
  EXPECT_EQ(table.freq_hz, (std::vector<double>{440, 880}));
  EXPECT_NEAR(table.decay_per_s[0], std::log(1000.0) / 3, 1e-12);
  EXPECT_EQ(table.gains, (std::vector<std::vector<double>>{{1, 0.5}, {2, -1}}));
  EXPECT_EQ(table.points_m[1], (Vec3{0.05, 0, 0}));
}

TEST_F(Table, that_is_wrong_is_refused_with_its_line) {
  const std::string head = "frequency_hz,decay_per_s,gain\n";
  EXPECT_THAT(find_fault(""), HasSubstr("no modes; give"));
  EXPECT_THAT(find_fault(head), HasSubstr("no modes; give"));
  EXPECT_THAT(find_fault("frequency_hz,gain\n1,2\n"), HasSubstr(":1: give one of the columns decay_per_s and t60_s"));
  EXPECT_THAT(find_fault("decay_per_s,gain\n1,2\n"), HasSubstr(":1: column frequency_hz is missing"));
  EXPECT_THAT(find_fault("frequency_hz,decay_per_s\n1,2\n"), HasSubstr(":1: give a column gain"));
  EXPECT_THAT(find_fault("frequency_hz,decay_per_s,gain,0 0 0\n1,2,3,4\n"), HasSubstr("not both"));
  EXPECT_THAT(find_fault("frequency_hz,decay_per_s,gain,gain\n1,2,3,4\n"), HasSubstr("twice"));
  EXPECT_THAT(find_fault("frequency_hz,decay_per_s,0 0 0,0 1 0,0 0.0 0\n1,2,3,4,5\n"), HasSubstr(":1: the point \"0 0.0 0\" occurs twice"));
  EXPECT_THAT(find_fault("frequency_hz,decay_per_s,gian\n1,2,3\n"), HasSubstr("column \"gian\" is not known"));
  EXPECT_THAT(find_fault(head + "440,2\n"), HasSubstr(":2: 2 values, and there are 3 columns"));
  EXPECT_THAT(find_fault("frequency_hz,decay_per_s,0 0 1e300\n1,2,3\n"), HasSubstr("the point \"0 0 1e300\" is too far away"));
  EXPECT_LT(find_fault(head + std::string(100000, 'x') + ",2,1\n").size(), 1000U);
  EXPECT_THAT(find_fault(head + "440,2,x\n"), HasSubstr(":2: \"x\" is not a finite number"));
  EXPECT_THAT(find_fault(head + "440,nan,1\n"), HasSubstr("not a finite number"));
  EXPECT_THAT(find_fault(head + "\n-3,2,1\n"), HasSubstr(":3: a frequency is -3 Hz"));
  EXPECT_THAT(find_fault(head + "440,-1,1\n"), HasSubstr("the decay is -1"));
  EXPECT_THAT(find_fault(head + "440,5000,1\n"), HasSubstr("is oscillatory from 0 to"));
  EXPECT_THAT(find_fault("frequency_hz,t60_s,gain\n440,0,1\n"), HasSubstr("t60_s is 0"));
  EXPECT_THAT(find_fault(head + "440,1,1e300\n"), HasSubstr("more than any body has"));
}

TEST_F(Table, cut_and_flipped_anywhere_is_read_or_refused) {
  const std::string whole = "frequency_hz,t60_s,0 0 0.05,0.05 0 0\n440,3,1,0.5\n880,1.5,2,-1\n";
  for (std::size_t at = 0; at < whole.size(); ++at) {
    (void)find_fault(whole.substr(0, at));
    for (const char other : {'\0', ',', '\n', '\xff', '9'}) {
      std::string flipped = whole;
      flipped[at] = other;
      (void)find_fault(flipped);
    }
  }
}

TEST_F(Table, becomes_a_bank_with_its_own_decays) {
  write("frequency_hz,decay_per_s,0 0 0.05,0 0 -0.05\n440,2,1,3\n440,2,2,1\n880,9,0.5,0.5\n");
  const job::JobSpec job = job::parse_job(
      R"({"body": {"modes_csv": ")" + file_.string() + R"(", "mass_kg": 0.4, "size_m": [0.1, 0.1, 0.1]}, "bank": "b.hdf"})", "/tmp/j.json");
  const bank::Bank bank = make_bank(job).bank;
  EXPECT_TRUE(bank::find_faults(bank).empty()) << bank::find_faults(bank)[0];
  ASSERT_EQ(bank.mode_count(), 3u);
  EXPECT_NEAR(bank.decay_per_s[1], 2.0, 1e-12);
  EXPECT_NEAR(bank.decay_per_s[2], 9.0, 1e-12);
  EXPECT_EQ(bank.damping.law, "loss_table");
  const std::vector<ModeAtPoint> top = calc_modes_at(job, {0, 0, 0.05}), bottom = calc_modes_at(job, {0, 0, -0.05});
  EXPECT_EQ(top[0].phi[2], 1.0);
  EXPECT_EQ(bottom[0].phi[2], -3.0);  // outward
  // Two decays at one frequency are kept, without a law.
  write("frequency_hz,decay_per_s,gain\n440,2,1\n440,5,2\n");
  const bank::Bank twins = make_bank(job).bank;
  EXPECT_EQ(twins.damping.law, "mixed");
  EXPECT_EQ(twins.decay_per_s, (std::vector<double>{2, 5}));
  EXPECT_TRUE(bank::find_faults(twins).empty());
}

TEST_F(Table, needs_a_box_about_its_points) {
  write("frequency_hz,decay_per_s,0 0 0.5,0 0 -0.5\n440,2,1,3\n");
  const job::JobSpec job = job::parse_job(
      R"({"body": {"modes_csv": ")" + file_.string() + R"(", "mass_kg": 0.4, "size_m": [0.1, 0.1, 0.1]}, "bank": "b.hdf"})", "/tmp/j.json");
  EXPECT_THROW(make_bank(job), InputError);
}

}  // namespace
}  // namespace carillon::analytic
