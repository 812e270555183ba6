"""What a traced slave is written as: C for one FMU, for lanes, for a microcontroller; tables, descriptions of FMI."""
