/* Sensors: where they stood, by option sensor: the same places in all frames, or a file of places per frame.
 *
 *     X,Y,Z             one that stands still; several: X,Y,Z:X,Y,Z
 *     FILE              lines "X Y Z": one sensor, a line per frame in order; or lines "NUMBER X Y Z": the
 *                       frame's number, a line per sensor.  Empty lines and lines that begin with # are
 *                       skipped. */
#ifndef NPG_SENSORS_H
#define NPG_SENSORS_H

#include <stdbool.h>

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"

#define NPG_SENSOR_LINES 4000000 /* of a file: 18 hours at 60 a second     */

typedef struct npg_sensor_place {
    int64_t frame; /* its number, or place in order */
    size_t line;
    double world[3];
} npg_sensor_place;

typedef struct npg_sensors {
    const char *text; /* as given, a loan */
    bool is_file, has_numbers;
    npg_sensor_place *places; /* by frame; owned */
    size_t count, capacity;
} npg_sensors;

/* NPG_USAGE for what is neither places nor a file; NPG_BAD_INPUT names the file and its line. */
npg_status npg_sensors_open(npg_sensors *sensors, const char *text);
void npg_sensors_close(npg_sensors *sensors);

/* Give the frame its sensors, instead of those it had; which of them saw which point is left as it is.
 * NPG_BAD_INPUT: the file has none for it. */
npg_status npg_sensors_set(const npg_sensors *sensors, npg_frame *frame, const npg_origin *origin);

#endif
