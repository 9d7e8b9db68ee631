/* A library with OpenNI2's C interface (OniCAPI.h, OniCTypes.h of release 2.2), as far as a depth stream needs it.

   Its one camera is set to 320 by 240 mirrored pixels of a millimetre when it is opened (assumed). The environment says
   what is wrong with it: FAKE_ONI is "none" (no camera), "hang" (images never come), "pulled" (after three images)
   or "coarse" (it offers other images only). */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { OK = 0, ERROR = 1, NO_DEVICE = 6 };
enum { VIDEO_MODE = 3, MIRRORING = 7, DEPTH_SENSOR = 3, DEPTH_1_MM = 100, DEPTH_100_UM = 101 };

typedef struct { int format, width, height, fps; } VideoMode;
typedef struct { int type, count; VideoMode *modes; } SensorInfo;
typedef struct { char uri[256], vendor[256], name[256]; uint16_t usb_vendor, usb_product; } DeviceInfo;
typedef struct {
  int size; void *data; int sensor; uint64_t stamp_us; int index, width, height; VideoMode mode;
  int is_cropped, crop_x, crop_y, stride;
} Frame;

static VideoMode modes[] = {
  {DEPTH_1_MM, 320, 240, 30}, {DEPTH_100_UM, 640, 480, 30}, {DEPTH_1_MM, 640, 480, 30}, {DEPTH_1_MM, 640, 480, 60},
};
static SensorInfo sensor = {DEPTH_SENSOR, 4, modes};
static VideoMode now = {DEPTH_1_MM, 320, 240, 30};
static int is_mirrored = 1, is_started = 0, images = 0, handle;
static char told[256] = "";

static int is(const char *fault) {
  const char *set = getenv("FAKE_ONI");
  return set && strcmp(set, fault) == 0;
}

static int fail(int status, const char *why) { strncpy(told, why, sizeof told - 1); return status; }

int oniInitialize(int version) { return version == 2002 ? OK : fail(ERROR, "another version"); }
void oniShutdown(void) {}
const char *oniGetExtendedError(void) { return told; }

int oniDeviceOpen(const char *uri, void **device) {
  if (is("none")) return fail(NO_DEVICE, "DeviceOpen using default: no devices found");
  if (uri && strcmp(uri, "1d27/0601@1/4")) return fail(NO_DEVICE, "no such device");
  *device = &handle;
  return OK;
}
int oniDeviceClose(void *device) { return OK; }
int oniDeviceGetInfo(void *device, DeviceInfo *info) {
  memset(info, 0, sizeof *info);
  strcpy(info->uri, "1d27/0601@1/4");
  return OK;
}
int oniDeviceIsPropertySupported(void *device, int property) { return 0; }
int oniDeviceIsCommandSupported(void *device, int command) { return 0; }
const SensorInfo *oniDeviceGetSensorInfo(void *device, int type) {
  sensor.count = is("coarse") ? 2 : 4;
  return type == DEPTH_SENSOR ? &sensor : NULL;
}
int oniDeviceCreateStream(void *device, int type, void **stream) { *stream = &handle; return OK; }
const SensorInfo *oniStreamGetSensorInfo(void *stream) { return oniDeviceGetSensorInfo(stream, DEPTH_SENSOR); }
void oniStreamDestroy(void *stream) {}
int oniStreamIsPropertySupported(void *stream, int property) {
  return property == VIDEO_MODE || property == MIRRORING;
}
int oniStreamSetProperty(void *stream, int property, const void *data, int size) {
  if (is_started) return fail(ERROR, "the stream runs");
  if (property == VIDEO_MODE && size == sizeof now) { memcpy(&now, data, sizeof now); is_mirrored = 1; return OK; }
  if (property == MIRRORING && size == 4) { is_mirrored = *(const int *)data; return OK; }
  return fail(ERROR, "a bad property");
}
int oniStreamStart(void *stream) { is_started = 1; return OK; }
void oniStreamStop(void *stream) { is_started = 0; }

/* Millimetres: the number of the image, then its column as the camera sees it from the left. */
int oniStreamReadFrame(void *stream, Frame **given) {
  if (is("hang")) for (;;) pause();
  if (is("pulled") && images == 3) return fail(NO_DEVICE, "the device was disconnected");
  usleep(20000); /* longer than the period of 60 Hz, so that the source leaves out none */
  int count = now.width * now.height;
  Frame *frame = calloc(1, sizeof *frame);
  uint16_t *pixels = malloc(2 * count);
  images += 1;
  for (int k = 0; k < count; k++) {
    int column = k % now.width;
    pixels[k] = is_mirrored ? now.width - 1 - column : column;
  }
  pixels[0] = images;
  *frame = (Frame){2 * count, pixels, DEPTH_SENSOR, 33333ull * images, images, now.width, now.height, now, 0, 0, 0, 2 * now.width};
  *given = frame;
  return OK;
}
void oniFrameRelease(Frame *frame) { free(frame->data); free(frame); }
