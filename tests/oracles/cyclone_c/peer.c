// A program of Cyclone DDS's C library alone: sends one JointState, or prints the first that comes.
//   peer send DOMAIN TOPIC       a message of two joints, once somebody listens; ends when it is acknowledged
//   peer take DOMAIN TOPIC       a line of what came
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dds/dds.h"
#include "joint_state.h"

typedef sensor_msgs_msg_dds__JointState_ JointState;

static void check(dds_return_t code, const char *what) {
    if (code >= 0) return;
    fprintf(stderr, "%s: %s\n", what, dds_strretcode(code));
    exit(1);
}

static void print_numbers(const char *name, const dds_sequence_double *numbers) {
    printf(" %s", name);
    for (uint32_t k = 0; k < numbers->_length; k++) printf("%c%.17g", k ? ',' : '=', numbers->_buffer[k]);
}

static int send(dds_entity_t participant, dds_entity_t topic, dds_qos_t *qos) {
    dds_entity_t writer = dds_create_writer(participant, topic, qos, NULL);
    check(writer, "writer");
    dds_publication_matched_status_t status = {0};
    for (int k = 0; k < 3000 && status.current_count == 0; k++) {
        dds_sleepfor(DDS_MSECS(10));
        check(dds_get_publication_matched_status(writer, &status), "status");
    }
    char *names[] = {"shoulder", "elbow"};
    double position[] = {1.5, -2.0}, effort[] = {0.25, 0.5};
    JointState message;
    memset(&message, 0, sizeof message);
    message.header.stamp.sec = 3;
    message.header.stamp.nanosec = 5;
    message.header.frame_id = "base";
    message.name._length = 2, message.name._buffer = names;
    message.position._length = 2, message.position._buffer = position;
    message.effort._length = 2, message.effort._buffer = effort;
    check(dds_write(writer, &message), "write");
    check(dds_wait_for_acks(writer, DDS_SECS(20)), "acknowledgement");
    puts("sent");
    return 0;
}

static int take(dds_entity_t participant, dds_entity_t topic, dds_qos_t *qos) {
    dds_entity_t reader = dds_create_reader(participant, topic, qos, NULL);
    check(reader, "reader");
    puts("ready");
    fflush(stdout);
    for (int k = 0; k < 3000; k++, dds_sleepfor(DDS_MSECS(10))) {
        void *sample = NULL;
        dds_sample_info_t info;
        dds_return_t count = dds_take(reader, &sample, &info, 1, 1);
        check(count, "take");
        if (count == 0 || !info.valid_data) continue;
        const JointState *message = sample;
        printf("stamp=%d.%09u frame=%s name", message->header.stamp.sec, message->header.stamp.nanosec,
               message->header.frame_id);
        for (uint32_t n = 0; n < message->name._length; n++)
            printf("%c%s", n ? ',' : '=', message->name._buffer[n]);
        print_numbers("position", &message->position);
        print_numbers("velocity", &message->velocity);
        print_numbers("effort", &message->effort);
        putchar('\n');
        return 0;
    }
    fputs("nothing came\n", stderr);
    return 1;
}

int main(int count, char **arguments) {
    if (count != 4) return 2;
    dds_entity_t participant = dds_create_participant((dds_domainid_t)atoi(arguments[2]), NULL, NULL);
    check(participant, "participant");
    dds_entity_t topic =
        dds_create_topic(participant, &sensor_msgs_msg_dds__JointState__desc, arguments[3], NULL, NULL);
    check(topic, "topic");
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
    int code = strcmp(arguments[1], "send") == 0 ? send(participant, topic, qos) : take(participant, topic, qos);
    dds_delete_qos(qos);
    check(dds_delete(participant), "end");
    return code;
}
