// terrain_mujoco: carillon/mujoco.h with a height field and a body of two geoms. Impulses are the change of momentum, points lie on the
// field. This program takes the place of the tracker.
#include <carillon/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "tests/system/engines/tracker.hpp"

namespace {

constexpr int kBodies = 2, kSteps = 6000, kSide = 41;  // ball, dumb-bell
constexpr double kStep = 2.5e-4, kHalfM = 2.0, kTopM = 0.04;

const char* const kModel =
    "<mujoco><option timestep='0.00025' cone='elliptic'/><default><geom friction='0.4 0.0001 0.00001' solref='0.008 0.5' "
    "condim='4'/></default>"
    "<asset><hfield name='hills' nrow='41' ncol='41' size='2 2 0.04 0.1'/></asset><worldbody><geom type='hfield' hfield='hills'/>"
    "<body name='ball' pos='0.1 0 0.2'><freejoint/><geom type='sphere' size='0.03' mass='0.5'/></body>"
    "<body name='bell' pos='1 0.3 0.2' euler='10 0 0'><freejoint/><geom type='sphere' size='0.03' pos='-0.05 0 0' mass='0.2'/>"
    "<geom type='sphere' size='0.03' pos='0.05 0 0' mass='0.2'/></body></worldbody></mujoco>";

carillon::testing::OnTerrain seen[kBodies];

double calc_height(double x, double y) { return 0.5 * kTopM * (1.0 + std::cos(x) * std::cos(y)); }

}  // namespace

void carillon::testing::take(const carillon_point& p) { seen[p.a].add(p, calc_height(p.point_m[0], p.point_m[1])); }

int main() {
  std::FILE* file = std::fopen("terrain.xml", "w");
  if (file == nullptr || std::fputs(kModel, file) < 0 || std::fclose(file) != 0)
    return std::fputs("terrain.xml: cannot be written\n", stderr), 1;
  char message[1000] = "";
  mjModel* model = mj_loadXML("terrain.xml", nullptr, message, sizeof message);
  if (model == nullptr) return std::fprintf(stderr, "terrain.xml: %s\n", message), 1;
  for (int row = 0; row < kSide; ++row)
    for (int column = 0; column < kSide; ++column) {
      const double x = kHalfM * (2.0 * column / (kSide - 1) - 1.0), y = kHalfM * (2.0 * row / (kSide - 1) - 1.0);
      model->hfield_data[row * kSide + column] = static_cast<float>(calc_height(x, y) / kTopM);
    }
  mjData* data = mj_makeData(model);
  carillon::MujocoTouches reader(model, data, nullptr);
  const char* const names[] = {"ball", "bell"};
  const double masses_kg[] = {0.5, 0.4};
  for (int i = 0; i < kBodies; ++i) reader.add(mj_name2id(model, mjOBJ_BODY, names[i]), i);
  data->qvel[0] = 0.3;
  reader.start(message, sizeof message);
  const std::vector<carillon_pose> begin = carillon::testing::now;
  for (int n = 0; n < kSteps; ++n) {
    mj_step(model, data);
    reader.step(message, sizeof message);
  }
  bool is_right = true;
  for (int i = 0; i < kBodies; ++i)
    is_right = seen[i].is_right(names[i], masses_kg[i], kSteps * kStep, begin[i], carillon::testing::now[i], 1e-3) && is_right;
  mj_deleteData(data);
  mj_deleteModel(model);
  return is_right ? 0 : 1;
}
