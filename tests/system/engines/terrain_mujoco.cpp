// terrain_mujoco: carillon/mujoco.h with a height field and a body of two geoms. Impulses are the change of momentum, points lie on the
// field. This program takes the place of the tracker.
#include <carillon/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

namespace {

constexpr int kBodies = 2, kSteps = 6000, kSide = 41;  // ball, dumb-bell
constexpr double kStep = 2.5e-4, kGravity = 9.81, kRadius = 0.03, kHalfM = 2.0, kTopM = 0.04;

const char* const kModel =
    "<mujoco><option timestep='0.00025' cone='elliptic'/><default><geom friction='0.4 0.0001 0.00001' solref='0.008 0.5' "
    "condim='4'/></default>"
    "<asset><hfield name='hills' nrow='41' ncol='41' size='2 2 0.04 0.1'/></asset><worldbody><geom type='hfield' hfield='hills'/>"
    "<body name='ball' pos='0.1 0 0.2'><freejoint/><geom type='sphere' size='0.03' mass='0.5'/></body>"
    "<body name='bell' pos='1 0.3 0.2' euler='10 0 0'><freejoint/><geom type='sphere' size='0.03' pos='-0.05 0 0' mass='0.2'/>"
    "<geom type='sphere' size='0.03' pos='0.05 0 0' mass='0.2'/></body></worldbody></mujoco>";

std::vector<carillon_pose> poses;
double impulses_n_s[kBodies], off_m = 0.0;
long points_seen[kBodies];

double calc_height(double x, double y) { return 0.5 * kTopM * (1.0 + std::cos(x) * std::cos(y)); }

}  // namespace

// In place of the library.
extern "C" {
carillon_status carillon_touches_start(carillon_touches*, double, const carillon_pose* given, int32_t bodies, char*, size_t) {
  poses.assign(given, given + bodies);
  return CARILLON_OK;
}
carillon_status carillon_touches_step(carillon_touches*, double, const carillon_pose* given, int32_t bodies, const carillon_point* points,
                                      int32_t count, char*, size_t) {
  for (int32_t i = 0; i < count; ++i) {
    const carillon_point& p = points[i];
    ++points_seen[p.a];
    impulses_n_s[p.a] += p.impulse_n_s * p.normal[2] + p.friction_n_s[2];
    off_m = std::max(off_m, std::abs(p.point_m[2] - calc_height(p.point_m[0], p.point_m[1])));
  }
  poses.assign(given, given + bodies);
  return CARILLON_OK;
}
}

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
  const std::vector<carillon_pose> begin = poses;
  for (int n = 0; n < kSteps; ++n) {
    mj_step(model, data);
    reader.step(message, sizeof message);
  }
  bool is_right = off_m < 1e-3;
  for (int i = 0; i < kBodies; ++i) {
    const double weight_n_s = masses_kg[i] * kGravity * kSteps * kStep;
    const double gained = masses_kg[i] * (poses[i].velocity_m_s[2] - begin[i].velocity_m_s[2]);
    const double error = (gained - impulses_n_s[i] + weight_n_s) / weight_n_s;
    std::printf("%s: %ld points, impulses off by %.2g of the weight\n", names[i], points_seen[i], error);
    is_right = is_right && points_seen[i] > 100 && std::abs(error) < 1e-3;
  }
  std::printf("points off by %.2g m\n", off_m);
  mj_deleteData(data);
  mj_deleteModel(model);
  return is_right ? 0 : 1;
}
