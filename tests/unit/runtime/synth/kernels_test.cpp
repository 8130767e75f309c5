// Every instruction set against plain loops in double precision, for all counts of modes around the vector widths.
#include "runtime/synth/kernels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include "tests/support/instruction_sets.hpp"

namespace carillon::synth {
namespace {

using Complex = std::complex<double>;

/// `modes` modes with random tables; empty lanes zero.
struct Invented {
  std::vector<SoundTable> sound;
  std::vector<RotationTable> turn;
  std::vector<StrikeTable> strike;
  std::vector<ModeState> state;
  std::vector<ColumnStates> starts;
  std::vector<std::int16_t> rows;
  PulseBlock touch{};
  int groups, modes;

  explicit Invented(int count) : groups(std::max(1, (count + kGroup - 1) / kGroup)), modes(count) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> number(-1.0F, 1.0F);
    const std::size_t size = groups;
    sound.resize(size), turn.resize(size), strike.resize(size), state.resize(size), starts.resize(size);
    for (auto& table : sound) std::memset(&table, 0, sizeof(table));
    for (auto& table : turn) std::memset(&table, 0, sizeof(table));
    for (auto& table : strike) std::memset(&table, 0, sizeof(table));
    for (auto& table : state) std::memset(&table, 0, sizeof(table));
    rows.assign(kStrikeRows * groups * kGroup, 0);
    for (int m = 0; m < modes; ++m) {
      const std::size_t g = m / kGroup;
      const int l = m % kGroup;
      for (auto& part : sound[g].wave[l / 2]) {
        for (auto& sample : part) sample[l % 2] = number(random);
      }
      turn[g].block_re[l] = number(random), turn[g].block_im[l] = number(random);
      for (int i = 0; i < 3; ++i) turn[g].columns_re[i][l] = 0.7F * number(random), turn[g].columns_im[i][l] = 0.7F * number(random);
      const float angle = number(random);
      strike[g].turn_re[l] = std::cos(angle), strike[g].turn_im[l] = std::sin(angle);
      strike[g].out_re[l] = number(random), strike[g].out_im[l] = number(random);
      strike[g].scale[l] = 1e-4F * number(random);
      for (int j = 0; j < kTerms; ++j) strike[g].force_re[j][l] = number(random), strike[g].force_im[j][l] = number(random);
      state[g].re[l] = number(random), state[g].im[l] = number(random);
      for (int r = 0; r < kStrikeRows; ++r) rows[row(r) + static_cast<std::size_t>(m)] = static_cast<std::int16_t>(32767 * number(random));
    }
    for (int r = 0; r < kStrikeRows; ++r) touch.row[r] = rows.data() + row(r), touch.weight[r] = number(random);
    touch.first = 5, touch.last = 23;
    for (auto& sample : touch.moment) {
      for (float& x : sample) x = number(random);
    }
  }
  std::size_t row(int r) const { return r * groups * kGroup; }
};

constexpr int kEach = kSubBlock / kColumn;  // columns of a sub-block

/// State of a mode at the start of a column; after the last one, at the start of the next block.
Complex get_start(const Invented& of, std::size_t g, int l, int column) {
  if (column == kColumns) return {of.state[g].re[l], of.state[g].im[l]};
  return {of.starts[g].re[column][l], of.starts[g].im[column][l]};
}

/// State `columns` later, free motion, by the binary digits.
Complex turn_on(const Invented& of, std::size_t g, int l, Complex x, int columns) {
  for (int i = 0; i < 3; ++i) {
    if ((columns >> i) % 2 != 0) x *= Complex(of.turn[g].columns_re[i][l], of.turn[g].columns_im[i][l]);
  }
  return x;
}

const std::array<int, 12> kCounts{0, 1, 2, 3, 4, 7, 8, 15, 16, 17, 33, 160};

TEST(Kernels, TheBestExists) {
  EXPECT_EQ(get_kernels(Isa::kBest).isa, base::find_instructions());
  for (const Isa isa : base::list_instructions()) EXPECT_EQ(get_kernels(isa).isa, isa);
  tests::for_each_instruction_set([] { EXPECT_EQ(get_kernels(Isa::kBest).isa, base::find_instructions()); });
  EXPECT_STREQ(get_name(Isa::kAvx2), "avx2");
}

TEST(Kernels, AdvanceTurnsTheStateAndFillsTheStarts) {
  for (const Isa isa : base::list_instructions()) {
    for (const int count : kCounts) {
      Invented now(count);
      const Invented before(count);
      get_kernels(isa).advance(now.turn.data(), now.state.data(), now.starts.data(), now.groups);
      for (int m = 0; m < now.groups * kGroup; ++m) {
        const std::size_t g = m / kGroup;
        const int l = m % kGroup;
        const Complex z(before.state[g].re[l], before.state[g].im[l]);
        const Complex turned = z * Complex(before.turn[g].block_re[l], before.turn[g].block_im[l]);
        ASSERT_NEAR(now.state[g].re[l], turned.real(), 1e-15) << get_name(isa) << ", " << count << " modes";
        ASSERT_NEAR(now.state[g].im[l], turned.imag(), 1e-15);
        for (int q = 0; q < kColumns; ++q) {
          const Complex start = turn_on(before, g, l, z, q);
          ASSERT_NEAR(now.starts[g].re[q][l], start.real(), 3e-7);
          ASSERT_NEAR(now.starts[g].im[q][l], start.imag(), 3e-7);
        }
      }
    }
  }
}

TEST(Kernels, EmitSumsTheSoundOfAllModes) {
  for (const Isa isa : base::list_instructions()) {
    for (const int count : kCounts) {
      Invented invented(count);
      get_kernels(isa).advance(invented.turn.data(), invented.state.data(), invented.starts.data(), invented.groups);
      for (int first = 0; first < kSubBlocks; ++first) {
        for (int sub_blocks = 1; first + sub_blocks <= kSubBlocks; ++sub_blocks) {
          std::vector<float> out(kBlock, 0.5F);
          get_kernels(isa).emit(invented.sound.data(), invented.starts.data(), invented.groups, first, sub_blocks, out.data());
          for (int n = 0; n < kBlock; ++n) {
            double expected = 0.5, size = 1.0;
            for (int m = 0; m < count && n < sub_blocks * kSubBlock; ++m) {
              const std::size_t g = m / kGroup;
              const int l = m % kGroup, q = first * kEach + n / kColumn, k = n % kColumn;
              const double a = static_cast<double>(invented.starts[g].re[q][l]) * invented.sound[g].wave[l / 2][0][k][l % 2];
              const double b = static_cast<double>(invented.starts[g].im[q][l]) * invented.sound[g].wave[l / 2][1][k][l % 2];
              expected += a + b;
              size += std::abs(a) + std::abs(b);
            }
            ASSERT_NEAR(out[n], expected, 2e-6 * size) << get_name(isa) << ", " << count << " modes, " << sub_blocks;
          }
        }
      }
    }
  }
}

TEST(Kernels, TheDivisionOfABlockDoesNotChangeABit) {
  for (const Isa isa : base::list_instructions()) {
    const Kernels& kernels = get_kernels(isa);
    for (const int count : {16, 33, 160, 400}) {
      Invented whole(count), cut(count);
      std::vector<float> rung(kBlock, 0.0F);
      kernels.ring(whole.sound.data(), whole.turn.data(), whole.state.data(), whole.groups, rung.data());
      kernels.advance(cut.turn.data(), cut.state.data(), cut.starts.data(), cut.groups);
      for (const std::vector<int>& pieces : {std::vector<int>{4}, {1, 1, 1, 1}, {2, 2}, {3, 1}, {1, 3}, {1, 2, 1}}) {
        std::vector<float> out(kBlock, 0.0F);
        int first = 0;
        for (const int sub_blocks : pieces) {
          kernels.emit(cut.sound.data(), cut.starts.data(), cut.groups, first, sub_blocks, out.data() + first * kSubBlock);
          first += sub_blocks;
        }
        ASSERT_EQ(std::memcmp(out.data(), rung.data(), sizeof(float) * kBlock), 0) << get_name(isa) << ", " << count << " modes";
      }
      ASSERT_EQ(std::memcmp(whole.state.data(), cut.state.data(), sizeof(ModeState) * whole.state.size()), 0);
    }
  }
}

TEST(Kernels, AStrikeAddsItsAnswerAndLeavesItToTheRestOfThePeriod) {
  for (const Isa isa : base::list_instructions()) {
    for (const int count : kCounts) {
      for (int sub_block = 0; sub_block < kSubBlocks; ++sub_block) {
        Invented now(count);
        const Invented before(count);
        std::vector<float> out(kSubBlock, 0.25F);
        get_kernels(isa).strike(now.strike.data(), now.turn.data(), now.touch, sub_block, now.state.data(), now.starts.data(), now.groups,
                                out.data());
        std::vector<double> expected(kSubBlock, 0.25);
        double size = 1.0;
        for (int m = 0; m < count; ++m) {
          const std::size_t g = m / kGroup;
          const int l = m % kGroup;
          const StrikeTable& table = before.strike[g];
          double amplitude = 0.0;
          for (int r = 0; r < kStrikeRows; ++r) {
            amplitude += static_cast<double>(before.touch.weight[r]) * before.rows[before.row(r) + static_cast<std::size_t>(m)];
          }
          amplitude *= table.scale[l];
          const Complex turn(table.turn_re[l], table.turn_im[l]);
          Complex x = 0.0;
          for (int n = 0; n < kSubBlock; ++n) {
            x *= turn;
            for (int j = 0; j < kTerms && n >= before.touch.first && n < before.touch.last; ++j) {
              x += amplitude * before.touch.moment[n][j] * Complex(table.force_re[j][l], table.force_im[j][l]);
            }
            expected[n] += table.out_re[l] * x.real() + table.out_im[l] * x.imag();
            size += std::abs(x);
          }
          x *= turn;
          for (int q = (sub_block + 1) * kEach; q <= kColumns; ++q) {
            const Complex added = get_start(now, g, l, q) - get_start(before, g, l, q);
            ASSERT_LT(std::abs(added - turn_on(before, g, l, x, q - (sub_block + 1) * kEach)), 2e-5 * (1.0 + std::abs(x)))
                << get_name(isa) << ", " << count << " modes, sub_block " << sub_block;
          }
          for (int q = 0; q < (sub_block + 1) * kEach; ++q) ASSERT_EQ(now.starts[g].re[q][l], before.starts[g].re[q][l]);
        }
        for (std::size_t n = 0; n < expected.size(); ++n) ASSERT_NEAR(out[n], expected[n], 2e-6 * size) << get_name(isa) << ", " << count;
      }
    }
  }
}

// emit_weighted() equals emit() of weighted states.
TEST(Kernels, EmitWeightedIsEmitOfTheProducts) {
  for (const Isa isa : base::list_instructions()) {
    const Kernels& kernels = get_kernels(isa);
    for (const int count : kCounts) {
      Invented invented(count);
      kernels.advance(invented.turn.data(), invented.state.data(), invented.starts.data(), invented.groups);
      std::vector<ModeWeight> weight(invented.sound.size());
      std::mt19937 random(13);
      std::uniform_real_distribution<float> number(-1.0F, 1.0F);
      for (auto& group : weight) {
        for (int l = 0; l < kGroup; ++l) group.re[l] = number(random), group.im[l] = number(random);
      }
      for (const auto& [first, sub_blocks] : {std::pair(0, 4), std::pair(1, 2), std::pair(3, 1)}) {
        std::vector<float> out(kBlock, 0.5F);
        kernels.emit_weighted(invented.sound.data(), invented.starts.data(), weight.data(), invented.groups, first, sub_blocks, out.data());
        for (int n = 0; n < kBlock; ++n) {
          double expected = 0.5, size = 1.0;
          for (int m = 0; m < count && n < sub_blocks * kSubBlock; ++m) {
            const std::size_t g = m / kGroup;
            const int l = m % kGroup, k = n % kColumn;
            const Complex z = get_start(invented, g, l, first * kEach + n / kColumn) * Complex(weight[g].re[l], weight[g].im[l]);
            const double a = z.real() * static_cast<double>(invented.sound[g].wave[l / 2][0][k][l % 2]);
            const double b = z.imag() * static_cast<double>(invented.sound[g].wave[l / 2][1][k][l % 2]);
            expected += a + b;
            size += std::abs(a) + std::abs(b);
          }
          ASSERT_NEAR(out[n], expected, 3e-6 * size) << get_name(isa) << ", " << count << ", " << sub_blocks;
        }
      }
    }
  }
}

/// Weight equivalent to a mode's table, out_re re + out_im im.
std::vector<ModeWeight> make_weight(const Invented& of) {
  std::vector<ModeWeight> weight(of.strike.size());
  for (std::size_t g = 0; g < weight.size(); ++g) {
    for (int l = 0; l < kGroup; ++l) weight[g].re[l] = of.strike[g].out_re[l], weight[g].im[l] = -of.strike[g].out_im[l];
  }
  return weight;
}

// The kept states of two pulses, weighed like the table, give the rendered sound; all else is unchanged.
TEST(Kernels, KeptStatesOfAStrikeAreItsSound) {
  for (const Isa isa : base::list_instructions()) {
    const Kernels& kernels = get_kernels(isa);
    for (const int count : kCounts) {
      Invented plain(count), kept(count);
      std::vector<float> sound(kSubBlock, 0.0F), same(kSubBlock, 0.0F), weighed(kSubBlock, 0.0F);
      std::vector<SampleStates> states(plain.sound.size(), SampleStates{});
      for (int pulse = 0; pulse < 2; ++pulse) {
        plain.touch.first = kept.touch.first = 3 + 9 * pulse;
        kernels.strike(plain.strike.data(), plain.turn.data(), plain.touch, 1, plain.state.data(), plain.starts.data(), plain.groups,
                       sound.data());
        kernels.strike_and_keep(kept.strike.data(), kept.turn.data(), kept.touch, 1, kept.state.data(), kept.starts.data(), kept.groups,
                                same.data(), states.data());
      }
      ASSERT_EQ(sound, same);
      ASSERT_EQ(std::memcmp(plain.state.data(), kept.state.data(), sizeof(ModeState) * kept.state.size()), 0);
      ASSERT_EQ(std::memcmp(plain.starts.data(), kept.starts.data(), sizeof(ColumnStates) * kept.starts.size()), 0);
      kernels.weigh(make_weight(kept).data(), states.data(), kept.groups, weighed.data());
      double size = 0.0;
      for (const SampleStates& group : states)
        for (const auto& lanes : group.re)
          for (const float x : lanes) size = std::max(size, static_cast<double>(std::abs(x)) * count);
      ASSERT_EQ(size > 0.0, count > 0);
      for (std::size_t n = 0; n < sound.size(); ++n) ASSERT_NEAR(weighed[n], sound[n], 3e-6 * size) << get_name(isa) << ", " << count;
    }
  }
}

TEST(Kernels, ADriveAddsItsForcesAndDampsTheRinging) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  for (const Isa isa : base::list_instructions()) {
    for (const int count : kCounts) {
      for (const bool forces : {false, true}) {
        for (const bool damps : {false, true}) {
          Invented now(count);
          for (auto& table : now.strike) std::fill(std::begin(table.angle), std::end(table.angle), 0.0F);
          for (int m = 0; m < count; ++m) now.strike[m / kGroup].angle[m % kGroup] = 1.0F + 0.5F * number(random);
          get_kernels(isa).advance(now.turn.data(), now.state.data(), now.starts.data(), now.groups);
          ContactBlock drive{};
          drive.contacts = 3;
          drive.forces = forces;
          drive.damps = damps;
          for (auto& ramp : drive.ramp) std::generate(std::begin(ramp), std::end(ramp), [&] { return number(random); });
          for (int c = 0; c < drive.contacts; ++c) {
            for (ContactEnd& push : drive.push[c]) {
              push.forces = forces && c != 1;  // one of them dampings only
              for (int r = 0; r < kStrikeRows; ++r) {
                push.row[r] = now.rows.data() + now.row((r + c) % kStrikeRows);
                push.force[r] = number(random);
                push.damping[r] = damps ? 0.3F * number(random) : 0.0F;
              }
              for (float& x : push.signal) x = push.forces ? number(random) : 0.0F;
            }
          }
          const int sub_block = count % kSubBlocks;
          const Invented before = now;
          std::vector<float> out(kSubBlock, 0.25F);
          get_kernels(isa).drive(now.strike.data(), now.turn.data(), drive, sub_block, now.state.data(), now.starts.data(), now.groups,
                                 out.data());
          Invented kept = before;
          std::vector<SampleStates> states(kept.sound.size(), SampleStates{});
          std::vector<float> same(kSubBlock, 0.25F), weighed(kSubBlock, 0.25F);
          for (int c = 0; c < drive.contacts; ++c) {
            for (ContactEnd& push : drive.push[c])
              for (int r = 0; r < kStrikeRows; ++r) push.row[r] = kept.rows.data() + kept.row((r + c) % kStrikeRows);
          }
          get_kernels(isa).drive_and_keep(kept.strike.data(), kept.turn.data(), drive, sub_block, kept.state.data(), kept.starts.data(),
                                          kept.groups, same.data(), states.data());
          ASSERT_EQ(out, same);
          ASSERT_EQ(std::memcmp(now.state.data(), kept.state.data(), sizeof(ModeState) * kept.state.size()), 0);
          get_kernels(isa).weigh(make_weight(kept).data(), states.data(), kept.groups, weighed.data());
          std::vector<double> expected(kSubBlock, 0.25);
          double size = 1.0;
          for (int m = 0; m < count; ++m) {
            const std::size_t g = m / kGroup;
            const int l = m % kGroup;
            const StrikeTable& table = now.strike[g];
            const auto calc_along = [&](const ContactEnd& push, const float* weight) {
              double along = 0.0;
              for (int r = 0; r < kStrikeRows; ++r) along += static_cast<double>(weight[r]) * push.row[r][m];
              return along * static_cast<double>(table.scale[l]);
            };
            std::array<double, kSubBlock + 1> force{};
            std::array<double, 2> loss{};
            for (int end = 0; end < 2; ++end) {
              double x = 0.0;
              for (int c = 0; c < drive.contacts; ++c) {
                const ContactEnd& push = drive.push[c][end];
                x += std::pow(calc_along(push, push.damping), 2.0);
                for (int n = 0; n <= kSubBlock && push.forces; ++n) force[n] += calc_along(push, push.force) * push.signal[n];
              }
              x /= 1.0 + x / static_cast<double>(table.angle[l]);
              loss[end] = 1.0 - 1.0 / (1.0 + x + x * x / 2.0 + x * x * x / 6.0);
            }
            const Complex turn(table.turn_re[l], table.turn_im[l]);
            Complex first = 0.0, second = 0.0;
            for (int j = 0; j < kTerms; ++j) {
              first += static_cast<double>(drive.ramp[0][j]) * Complex(table.force_re[j][l], table.force_im[j][l]);
              second += static_cast<double>(drive.ramp[1][j]) * Complex(table.force_re[j][l], table.force_im[j][l]);
            }
            Complex ringing = damps ? get_start(before, g, l, sub_block * kEach) : 0.0, made = 0.0;
            double kept = 1.0;
            for (int n = 0; n <= kSubBlock; ++n) {
              if (n > 0) {
                const double keep = 1.0 - (loss[0] + (n - 0.5) / kSubBlock * (loss[1] - loss[0]));
                kept *= keep;
                ringing *= turn * keep;
                made = made * turn * keep + (forces ? force[n - 1] * first + force[n] * second : Complex(0.0));
              }
              const Complex z = ringing + made;
              if (n < kSubBlock)
                expected[n] += static_cast<double>(table.out_re[l]) * z.real() + static_cast<double>(table.out_im[l]) * z.imag();
              size += std::abs(z);
            }
            for (int q = (sub_block + 1) * kEach; q <= kColumns; ++q) {
              const Complex expected_start = kept * get_start(before, g, l, q) + turn_on(before, g, l, made, q - (sub_block + 1) * kEach);
              ASSERT_LT(std::abs(get_start(now, g, l, q) - expected_start), (forces         ? 2e-5
                                                                             : q < kColumns ? 3e-7
                                                                                            : 1e-6) *
                                                                                (1.0 + std::abs(made)))
                  << get_name(isa) << ", " << count << " modes" << forces << damps;
            }
            for (int q = 0; q < (sub_block + 1) * kEach; ++q) ASSERT_EQ(now.starts[g].re[q][l], before.starts[g].re[q][l]);
          }
          for (std::size_t n = 0; n < expected.size(); ++n) {
            ASSERT_NEAR(out[n], expected[n], 2e-6 * size) << get_name(isa) << ", " << count;
            ASSERT_NEAR(weighed[n], expected[n], 2e-6 * size) << get_name(isa) << ", " << count;
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace carillon::synth
